#pragma once

// St. Venant-Kirchhoff hexahedra, plain or with the enhanced strain modes of enhanced_element.cpp,
// one per SIMD lane and without assembling anything. No Eigen types: compiled for several
// instruction sets.
namespace calipso::fem {

template <class Real>
constexpr int kHexLanes = 32 / static_cast<int>(sizeof(Real));  // 8 floats or 4 doubles

// Numbers per lane of a batch's constants, in this order: lambda, 2 mu, weights (8), inverse of the
// modes' stiffness (45, upper triangle by rows), then
//  boxes:   derivative scale per axis (3), mode of axis k at point q along axis k (8 x 3)
//  others:  half the inverse Jacobian at each point (8 x 9, rows: parent axes),
//           mode vectors (8 x 3 x 3)
constexpr int kHexCommon = 2 + 8 + 45;
constexpr int kBoxConstants = kHexCommon + 3 + 24;
constexpr int kHexConstants = kHexCommon + 72 + 72;
constexpr int kHexStress = 8 * 6;  // weighted stresses xx, yy, zz, xy, yz, zx of the points

// Batches of cells. Nodal fields hold four numbers per node, the fourth is zero. Results come as
// four numbers for slot 8 lanes b + lanes c + place(lane) of batch b and corner c.
template <class Real>
struct HexBatches {
  const int* node;        // [batch][corner][lane]
  const Real* constants;  // blocks of [number][lane]
  const long* block;      // of each batch: offset into constants
  int boxes;              // batches below this one consist of boxes
  bool enhanced;
};

// Where a lane's result stands among those of its corner.
template <class Real>
constexpr int hexPlace(int lane) {
  return sizeof(Real) == 4 ? 2 * (lane & 3) + (lane >> 2) : lane;
}

// What evaluation gives beside forces; null pointers: not wanted.
struct HexState {
  double* energy;      // [batch][lane], J
  double* dilatation;  // [batch][lane], least det F
  double* stress;      // [batch][kHexStress][lane]; what the tangent takes as geometric stress
  bool positive;       // shifts that stress by its least eigenvalue where negative
};

// Stiffness of one batch's cells, as the coarse grid sees them.
struct HexStiffness {
  // in: per axis and lane, 1 where the cell is the first half of the coarse cell around it, 0 where
  // the second
  alignas(32) float even[3][8];
  alignas(32) float K[24][24][8];       // P^T K_e P of the coarse cell's corners
  alignas(32) float diagonal[8][9][8];  // diagonal blocks of K_e
};

struct HexKernel {
  // Forces at positions x into `slots`.
  void (*evaluate)(const HexBatches<double>&, int begin, int end, const double* x, HexState state,
                   double* slots);
  // Tangent at positions x, its material part times `factor`, applied to u. stress null: no
  // geometric part.
  void (*multiply)(const HexBatches<double>&, int begin, int end, const double* x,
                   const double* stress, double factor, const double* u, double* slots);
  void (*multiplyFloat)(const HexBatches<float>&, int begin, int end, const float* x,
                        const float* stress, float factor, const float* u, float* slots);
  // Rows and columns of components that `free` marks as zero are left out.
  void (*stiffness)(const HexBatches<float>&, int batch, const float* x, const float* stress,
                    float factor, const float* free, HexStiffness*);
};

// The fastest one this processor can run.
const HexKernel& hexKernel();

namespace portable {
extern const HexKernel kHexKernel;
}
namespace avx2 {
extern const HexKernel kHexKernel;
}
namespace avx512 {
extern const HexKernel kHexKernel;
}

}  // namespace calipso::fem
