#pragma once

namespace calipso::fem {

// Three components of a node and a zero.
typedef float Quad __attribute__((vector_size(16)));

inline Quad loadQuad(const float* p) { return *reinterpret_cast<const Quad*>(p); }
inline void storeQuad(float* p, Quad v) { *reinterpret_cast<Quad*>(p) = v; }
inline Quad splat(float v) { return Quad{v, v, v, v}; }

// Block times vector; the block is stored by columns of four.
inline Quad multiplyBlock(const float* block, Quad v) {
  return loadQuad(block) * splat(v[0]) + loadQuad(block + 4) * splat(v[1]) +
         loadQuad(block + 8) * splat(v[2]);
}

}  // namespace calipso::fem
