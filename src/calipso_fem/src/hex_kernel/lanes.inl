// Vectors of lanes, and nodes brought into them and back. Included by each instruction set's
// hex_kernel_*.cpp inside its namespace, as are the other files of this folder.

template <class Real>
struct Simd;
template <>
struct Simd<float> {
  typedef float Lane __attribute__((vector_size(32)));
};
template <>
struct Simd<double> {
  typedef double Lane __attribute__((vector_size(32)));
};
template <class Real>
using LaneOf = typename Simd<Real>::Lane;

#if defined(CALIPSO_HEX_AVX)
inline void gather(const float* x, const int* node, LaneOf<float> out[3]) {
  __m256 row[4];
  for (int l = 0; l < 4; ++l)
    row[l] = _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_load_ps(x + 4L * node[l])),
                                  _mm_load_ps(x + 4L * node[l + 4]), 1);
  const __m256 a = _mm256_unpacklo_ps(row[0], row[1]), b = _mm256_unpackhi_ps(row[0], row[1]);
  const __m256 c = _mm256_unpacklo_ps(row[2], row[3]), d = _mm256_unpackhi_ps(row[2], row[3]);
  out[0] = _mm256_shuffle_ps(a, c, 0x44);
  out[1] = _mm256_shuffle_ps(a, c, 0xee);
  out[2] = _mm256_shuffle_ps(b, d, 0x44);
}

inline void gather(const double* x, const int* node, LaneOf<double> out[3]) {
  __m256d row[4];
  for (int l = 0; l < 4; ++l) row[l] = _mm256_load_pd(x + 4L * node[l]);
  const __m256d a = _mm256_unpacklo_pd(row[0], row[1]), b = _mm256_unpackhi_pd(row[0], row[1]);
  const __m256d c = _mm256_unpacklo_pd(row[2], row[3]), d = _mm256_unpackhi_pd(row[2], row[3]);
  out[0] = _mm256_permute2f128_pd(a, c, 0x20);
  out[1] = _mm256_permute2f128_pd(b, d, 0x20);
  out[2] = _mm256_permute2f128_pd(a, c, 0x31);
}

inline void scatter(const LaneOf<float> f[3], float* slots) {
  const __m256 zero = _mm256_setzero_ps();
  const __m256 a = _mm256_unpacklo_ps(f[0], f[1]), b = _mm256_unpackhi_ps(f[0], f[1]);
  const __m256 c = _mm256_unpacklo_ps(f[2], zero), d = _mm256_unpackhi_ps(f[2], zero);
  _mm256_store_ps(slots, _mm256_shuffle_ps(a, c, 0x44));
  _mm256_store_ps(slots + 8, _mm256_shuffle_ps(a, c, 0xee));
  _mm256_store_ps(slots + 16, _mm256_shuffle_ps(b, d, 0x44));
  _mm256_store_ps(slots + 24, _mm256_shuffle_ps(b, d, 0xee));
}

inline void scatter(const LaneOf<double> f[3], double* slots) {
  const __m256d zero = _mm256_setzero_pd();
  const __m256d a = _mm256_unpacklo_pd(f[0], f[1]), b = _mm256_unpackhi_pd(f[0], f[1]);
  const __m256d c = _mm256_unpacklo_pd(f[2], zero), d = _mm256_unpackhi_pd(f[2], zero);
  _mm256_store_pd(slots, _mm256_permute2f128_pd(a, c, 0x20));
  _mm256_store_pd(slots + 4, _mm256_permute2f128_pd(b, d, 0x20));
  _mm256_store_pd(slots + 8, _mm256_permute2f128_pd(a, c, 0x31));
  _mm256_store_pd(slots + 12, _mm256_permute2f128_pd(b, d, 0x31));
}
#else
template <class Real>
inline void gather(const Real* x, const int* node, LaneOf<Real> out[3]) {
  for (int l = 0; l < kHexLanes<Real>; ++l)
    for (int c = 0; c < 3; ++c) out[c][l] = x[4L * node[l] + c];
}

template <class Real>
inline void scatter(const LaneOf<Real> f[3], Real* slots) {
  for (int l = 0; l < kHexLanes<Real>; ++l) {
    Real* slot = slots + 4 * hexPlace<Real>(l);
    for (int c = 0; c < 3; ++c) slot[c] = f[c][l];
    slot[3] = Real(0);
  }
}
#endif
