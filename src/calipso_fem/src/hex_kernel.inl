// Included by hex_kernel_*.cpp inside their namespaces. Symmetric 3x3 tensors are stored as xx, yy,
// zz, xy, yz, zx. Point and corner q has the bits qx + 2 qy + 4 qz. Formulas: enhanced_element.cpp.

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

// ---- Nodes to lanes and back --------------------------------------------------------------------

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

// ---- Gradients
// ------------------------------------------------------------------------------------

// Derivative along parent axis k is constant along k: one value per pair of the other two bits.
inline int pairOf(int axis, int q) {
  const int x = q & 1, y = (q >> 1) & 1, z = q >> 2;
  return axis == 0 ? y + 2 * z : axis == 1 ? x + 2 * z : x + 2 * y;
}

// Lower corner of the edge along `axis` that belongs to a pair.
inline int edgeCorner(int axis, int pair) {
  const int a = pair & 1, b = pair >> 1;
  return axis == 0 ? 2 * a + 4 * b : axis == 1 ? a + 4 * b : a + 2 * b;
}

// From two edges to two Gauss points, (1 -+ 1/sqrt 3) / 2 of each; its own adjoint.
template <class V>
inline void interpolate(V& a, V& b) {
  typedef std::remove_reference_t<decltype(a[0])> Real;
  constexpr Real kShare = Real(0.21132486540518711775);
  const V d = b - a;
  a = a + kShare * d;
  b = b - kShare * d;
}

template <class V>
inline void interpolatePairs(V e[4]) {
  interpolate(e[0], e[1]);
  interpolate(e[2], e[3]);
  interpolate(e[0], e[2]);
  interpolate(e[1], e[3]);
}

template <class V>
struct Gradients {
  V g[3][3][4];  // [parent axis][component][pair]
};

// Constants of one batch.
template <class Real, bool kBox>
struct Constants {
  typedef LaneOf<Real> V;
  const V* c;
  V lambda() const { return c[0]; }
  V twoMu() const { return c[1]; }
  V weight(int q) const { return c[2 + q]; }
  const V* modeInverse() const { return c + 10; }
  V scale(int axis) const { return c[kHexCommon + axis]; }              // boxes
  V mode(int q, int k) const { return c[kHexCommon + 3 + 3 * q + k]; }  // boxes
  const V* jacobian(int q) const { return c + kHexCommon + 9 * q; }     // [parent axis][axis]
  const V* modeVector(int q, int k) const { return c + kHexCommon + 72 + 9 * q + 3 * k; }
};

template <class Real, bool kBox>
inline void gradients(const Constants<Real, kBox>& k, const LaneOf<Real> u[8][3],
                      Gradients<LaneOf<Real>>* out) {
  for (int axis = 0; axis < 3; ++axis)
    for (int c = 0; c < 3; ++c) {
      LaneOf<Real>* e = out->g[axis][c];
      for (int p = 0; p < 4; ++p) {
        const int low = edgeCorner(axis, p);
        e[p] = u[low + (1 << axis)][c] - u[low][c];
        if constexpr (kBox) e[p] *= k.scale(axis);
      }
      interpolatePairs(e);
    }
}

// F_cj of point q.
template <class Real, bool kBox>
inline void pointGradient(const Constants<Real, kBox>& k, const Gradients<LaneOf<Real>>& g, int q,
                          LaneOf<Real> F[3][3]) {
  for (int c = 0; c < 3; ++c)
    for (int j = 0; j < 3; ++j)
      if constexpr (kBox) {
        F[c][j] = g.g[j][c][pairOf(j, q)];
      } else {
        const auto* J = k.jacobian(q);
        F[c][j] = g.g[0][c][pairOf(0, q)] * J[j] + g.g[1][c][pairOf(1, q)] * J[3 + j] +
                  g.g[2][c][pairOf(2, q)] * J[6 + j];
      }
}

// Adjoint of pointGradient.
template <class Real, bool kBox>
inline void addPointStress(const Constants<Real, kBox>& k, const LaneOf<Real> P[3][3], int q,
                           Gradients<LaneOf<Real>>* h) {
  for (int c = 0; c < 3; ++c)
    for (int a = 0; a < 3; ++a)
      if constexpr (kBox) {
        h->g[a][c][pairOf(a, q)] += P[c][a];
      } else {
        const auto* J = k.jacobian(q) + 3 * a;
        h->g[a][c][pairOf(a, q)] += P[c][0] * J[0] + P[c][1] * J[1] + P[c][2] * J[2];
      }
}

// Adjoint of gradients(): forces of the corners.
template <class Real, bool kBox>
inline void cornerForces(const Constants<Real, kBox>& k, Gradients<LaneOf<Real>>* h,
                         LaneOf<Real> f[8][3]) {
  for (int corner = 0; corner < 8; ++corner)
    for (int c = 0; c < 3; ++c) f[corner][c] = LaneOf<Real>{};
  for (int axis = 0; axis < 3; ++axis)
    for (int c = 0; c < 3; ++c) {
      LaneOf<Real>* e = h->g[axis][c];
      interpolatePairs(e);
      for (int p = 0; p < 4; ++p) {
        if constexpr (kBox) e[p] *= k.scale(axis);
        const int low = edgeCorner(axis, p);
        f[low + (1 << axis)][c] += e[p];
        f[low][c] -= e[p];
      }
    }
}

template <class Real>
inline void scatterCorners(const LaneOf<Real> f[8][3], Real* slots) {
  for (int corner = 0; corner < 8; ++corner)
    scatter(f[corner], slots + 4 * kHexLanes<Real> * corner);
}

template <class Real>
inline void loadCorners(const HexBatches<Real>& b, int batch, const Real* x,
                        LaneOf<Real> out[8][3]) {
  constexpr int kLanes = kHexLanes<Real>;
  for (int c = 0; c < 8; ++c) gather(x, b.node + (8L * batch + c) * kLanes, out[c]);
}

// ---- Strains and stresses
// -------------------------------------------------------------------------

template <class V>
inline void hooke(V lambda, V two_mu, const V E[6], V S[6]) {
  const V pressure = lambda * (E[0] + E[1] + E[2]);
  for (int c = 0; c < 3; ++c) S[c] = two_mu * E[c] + pressure;
  for (int c = 3; c < 6; ++c) S[c] = two_mu * E[c];
}

// P = F S
template <class V>
inline void multiplySymmetric(const V F[3][3], const V S[6], V P[3][3]) {
  for (int c = 0; c < 3; ++c) {
    P[c][0] = F[c][0] * S[0] + F[c][1] * S[3] + F[c][2] * S[5];
    P[c][1] = F[c][0] * S[3] + F[c][1] * S[1] + F[c][2] * S[4];
    P[c][2] = F[c][0] * S[5] + F[c][1] * S[4] + F[c][2] * S[2];
  }
}

// load_k += w S m_k
template <class Real, bool kBox>
inline void addModeLoad(const Constants<Real, kBox>& k, int q, const LaneOf<Real> S[6],
                        LaneOf<Real> load[9]) {
  constexpr int kRow[3][3] = {{0, 3, 5}, {3, 1, 4}, {5, 4, 2}};
  const auto w = k.weight(q);
  for (int a = 0; a < 3; ++a)
    if constexpr (kBox) {
      const auto m = w * k.mode(q, a);
      for (int c = 0; c < 3; ++c) load[3 * a + c] += m * S[kRow[c][a]];
    } else {
      const auto* m = k.modeVector(q, a);
      for (int c = 0; c < 3; ++c)
        load[3 * a + c] += w * (S[kRow[c][0]] * m[0] + S[kRow[c][1]] * m[1] + S[kRow[c][2]] * m[2]);
    }
}

// amplitudes = - K_aa^-1 load
template <class Real, bool kBox>
inline void solveModes(const Constants<Real, kBox>& k, const LaneOf<Real> load[9],
                       LaneOf<Real> amplitude[9]) {
  for (int i = 0; i < 9; ++i) amplitude[i] = LaneOf<Real>{};
  const auto* entry = k.modeInverse();
  for (int i = 0; i < 9; ++i) {
    amplitude[i] -= *entry++ * load[i];
    for (int j = i + 1; j < 9; ++j, ++entry) {
      amplitude[i] -= *entry * load[j];
      amplitude[j] -= *entry * load[i];
    }
  }
}

// E += sym(sum_k a_k (x) m_k)
template <class Real, bool kBox>
inline void addModes(const Constants<Real, kBox>& k, int q, const LaneOf<Real> amplitude[9],
                     LaneOf<Real> E[6]) {
  typedef LaneOf<Real> V;
  constexpr Real kHalf = Real(0.5);
  if constexpr (kBox) {
    const V m0 = k.mode(q, 0), m1 = k.mode(q, 1), m2 = k.mode(q, 2);
    const V* a = amplitude;
    E[0] += a[0] * m0;
    E[1] += a[4] * m1;
    E[2] += a[8] * m2;
    E[3] += kHalf * (a[1] * m0 + a[3] * m1);
    E[4] += kHalf * (a[5] * m1 + a[7] * m2);
    E[5] += kHalf * (a[2] * m0 + a[6] * m2);
  } else {
    for (int b = 0; b < 3; ++b) {
      const V* m = k.modeVector(q, b);
      const V* a = amplitude + 3 * b;
      for (int c = 0; c < 3; ++c) E[c] += a[c] * m[c];
      E[3] += kHalf * (a[0] * m[1] + a[1] * m[0]);
      E[4] += kHalf * (a[1] * m[2] + a[2] * m[1]);
      E[5] += kHalf * (a[2] * m[0] + a[0] * m[2]);
    }
  }
}

// Smallest eigenvalue of a symmetric matrix (closed form), or 0 where that is positive.
inline double negativeEigenvalue(double a, double b, double c, double d, double e, double f) {
  const double mean = (a + b + c) / 3.0;
  const double p2 = (a - mean) * (a - mean) + (b - mean) * (b - mean) + (c - mean) * (c - mean) +
                    2.0 * (d * d + e * e + f * f);
  if (p2 <= 0.0) return mean < 0.0 ? mean : 0.0;
  const double p = __builtin_sqrt(p2 / 6.0);
  const double A = (a - mean) / p, B = (b - mean) / p, C = (c - mean) / p;
  const double D = d / p, E = e / p, F = f / p;
  double r = 0.5 * (A * (B * C - E * E) - D * (D * C - E * F) + F * (D * E - B * F));
  r = r < -1.0 ? -1.0 : r > 1.0 ? 1.0 : r;
  constexpr double kThirdTurn = 2.09439510239319549231;
  const double least = mean + 2.0 * p * __builtin_cos(__builtin_acos(r) / 3.0 + kThirdTurn);
  return least < 0.0 ? least : 0.0;
}

// ---- Batches
// ----------------------------------------------------------------------------------------

// Tangent at x applied to u: from the gradients of both to the adjoint gradients h.
template <class Real, bool kBox>
inline void multiplyGradients(const Constants<Real, kBox>& k, bool enhanced,
                              const Gradients<LaneOf<Real>>& of_x, const Real* stress, Real factor,
                              const Gradients<LaneOf<Real>>& of_u, Gradients<LaneOf<Real>>* h) {
  typedef LaneOf<Real> V;
  const V lambda = factor * k.lambda(), two_mu = factor * k.twoMu();
  V E[8][6], amplitude[9], load[9];
  for (V& l : load) l = V{};
  for (int q = 0; q < 8; ++q) {
    V F[3][3], D[3][3];
    pointGradient(k, of_x, q, F);
    pointGradient(k, of_u, q, D);
    for (int c = 0; c < 3; ++c) E[q][c] = F[0][c] * D[0][c] + F[1][c] * D[1][c] + F[2][c] * D[2][c];
    for (int c = 0; c < 3; ++c) {
      const int i = c, j = (c + 1) % 3;
      E[q][3 + c] = Real(0.5) * (F[0][i] * D[0][j] + F[1][i] * D[1][j] + F[2][i] * D[2][j] +
                                 F[0][j] * D[0][i] + F[1][j] * D[1][i] + F[2][j] * D[2][i]);
    }
    if (!enhanced) continue;
    V S[6];
    hooke(k.lambda(), k.twoMu(), E[q], S);
    addModeLoad(k, q, S, load);
  }
  if (enhanced) solveModes(k, load, amplitude);
  for (auto& axis : h->g)
    for (auto& component : axis)
      for (V& pair : component) pair = V{};
  const V* geometric = reinterpret_cast<const V*>(stress);
  for (int q = 0; q < 8; ++q) {
    if (enhanced) addModes(k, q, amplitude, E[q]);
    V S[6], F[3][3], D[3][3], P[3][3];
    hooke(lambda, two_mu, E[q], S);
    const V w = k.weight(q);
    for (V& s : S) s *= w;
    pointGradient(k, of_x, q, F);
    multiplySymmetric(F, S, P);
    if (stress) {
      V G[3][3];
      pointGradient(k, of_u, q, D);
      multiplySymmetric(D, geometric + 6 * q, G);
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) P[i][j] += G[i][j];
    }
    addPointStress(k, P, q, h);
  }
}

template <class Real, bool kBox>
inline void multiplyBatch(const HexBatches<Real>& b, int batch, const Real* x, const Real* stress,
                          Real factor, const Real* u, Real* slots) {
  typedef LaneOf<Real> V;
  const Constants<Real, kBox> k{reinterpret_cast<const V*>(b.constants + b.block[batch])};
  Gradients<V> of_x, of_u, h;
  V corner[8][3];
  loadCorners(b, batch, x, corner);
  gradients(k, corner, &of_x);
  loadCorners(b, batch, u, corner);
  gradients(k, corner, &of_u);
  multiplyGradients(k, b.enhanced, of_x, stress, factor, of_u, &h);
  cornerForces(k, &h, corner);
  scatterCorners<Real>(corner, slots);
}

// Along one axis, from a fine cell's two corners to those of the coarse cell around it, of which it
// is the first (even = 1) or second half (even = 0).
template <class V>
inline void toCoarse(V even, V& a, V& b) {
  const V coarse_a = 0.5f * ((1.0f + even) * a + even * b);
  b = 0.5f * ((1.0f - even) * a + (2.0f - even) * b);
  a = coarse_a;
}

template <bool kBox>
inline void stiffnessBatch(const HexBatches<float>& b, int batch, const float* x,
                           const float* stress, float factor, const float* free,
                           HexStiffness* out) {
  typedef LaneOf<float> V;
  const Constants<float, kBox> k{reinterpret_cast<const V*>(b.constants + b.block[batch])};
  Gradients<V> of_x, of_u, h;
  V corner[8][3], mask[8][3], f[8][3];
  loadCorners(b, batch, x, corner);
  gradients(k, corner, &of_x);
  loadCorners(b, batch, free, mask);
  auto* K = reinterpret_cast<V(*)[24]>(out->K);
  for (int column = 0; column < 24; ++column) {
    for (auto& c : corner)
      for (V& component : c) component = V{};
    corner[column / 3][column % 3] = mask[column / 3][column % 3];
    gradients(k, corner, &of_u);
    multiplyGradients(k, b.enhanced, of_x, stress, factor, of_u, &h);
    cornerForces(k, &h, f);
    for (int row = 0; row < 24; ++row)
      K[row][column] = mask[row / 3][row % 3] * f[row / 3][row % 3];
  }
  auto* diagonal = reinterpret_cast<V(*)[9]>(out->diagonal);
  for (int c = 0; c < 8; ++c)
    for (int i = 0; i < 9; ++i) diagonal[c][i] = K[3 * c + i / 3][3 * c + i % 3];
  for (int axis = 0; axis < 3; ++axis) {
    const V even = *reinterpret_cast<const V*>(out->even[axis]);
    for (int p = 0; p < 4; ++p) {
      const int low = 3 * edgeCorner(axis, p), high = low + (3 << axis);
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 24; ++j) toCoarse(even, K[low + i][j], K[high + i][j]);
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 24; ++j) toCoarse(even, K[j][low + i], K[j][high + i]);
    }
  }
}

template <class Real>
void multiplyBatches(const HexBatches<Real>& b, int begin, int end, const Real* x,
                     const Real* stress, Real factor, const Real* u, Real* slots) {
  constexpr int kLanes = kHexLanes<Real>;
  for (int k = begin; k < end; ++k) {
    const Real* s = stress ? stress + static_cast<long>(k) * kHexStress * kLanes : nullptr;
    Real* out = slots + 32L * kLanes * k;
    if (k < b.boxes)
      multiplyBatch<Real, true>(b, k, x, s, factor, u, out);
    else
      multiplyBatch<Real, false>(b, k, x, s, factor, u, out);
  }
}

template <bool kBox>
inline void evaluateBatch(const HexBatches<double>& b, int batch, const double* x, HexState state,
                          double* slots) {
  typedef LaneOf<double> V;
  const Constants<double, kBox> k{reinterpret_cast<const V*>(b.constants + b.block[batch])};
  Gradients<V> of_x, h;
  {
    V corner[8][3];
    loadCorners(b, batch, x, corner);
    gradients(k, corner, &of_x);
  }
  V E[8][6], amplitude[9], load[9], energy = V{}, least = V{} + 1e300;
  for (V& l : load) l = V{};
  for (int q = 0; q < 8; ++q) {
    V F[3][3], S[6];
    pointGradient(k, of_x, q, F);
    const V J = F[0][0] * (F[1][1] * F[2][2] - F[1][2] * F[2][1]) -
                F[0][1] * (F[1][0] * F[2][2] - F[1][2] * F[2][0]) +
                F[0][2] * (F[1][0] * F[2][1] - F[1][1] * F[2][0]);
    least = J < least ? J : least;
    for (int c = 0; c < 3; ++c) {
      const int i = c, j = (c + 1) % 3;
      E[q][c] = 0.5 * (F[0][c] * F[0][c] + F[1][c] * F[1][c] + F[2][c] * F[2][c] - 1.0);
      E[q][3 + c] = 0.5 * (F[0][i] * F[0][j] + F[1][i] * F[1][j] + F[2][i] * F[2][j]);
    }
    if (!b.enhanced) continue;
    hooke(k.lambda(), k.twoMu(), E[q], S);
    addModeLoad(k, q, S, load);
  }
  if (b.enhanced) solveModes(k, load, amplitude);
  for (auto& axis : h.g)
    for (auto& component : axis)
      for (V& pair : component) pair = V{};
  V* geometric = reinterpret_cast<V*>(state.stress);
  for (int q = 0; q < 8; ++q) {
    if (b.enhanced) addModes(k, q, amplitude, E[q]);
    V S[6], F[3][3], P[3][3];
    hooke(k.lambda(), k.twoMu(), E[q], S);
    const V* e = E[q];
    const V w = k.weight(q);
    energy +=
        0.5 * w *
        (S[0] * e[0] + S[1] * e[1] + S[2] * e[2] + 2.0 * (S[3] * e[3] + S[4] * e[4] + S[5] * e[5]));
    for (V& s : S) s *= w;
    if (slots) {
      pointGradient(k, of_x, q, F);
      multiplySymmetric(F, S, P);
      addPointStress(k, P, q, &h);
    }
    if (!geometric) continue;
    if (state.positive)
      for (int l = 0; l < kHexLanes<double>; ++l) {
        const double shift =
            negativeEigenvalue(S[0][l], S[1][l], S[2][l], S[3][l], S[4][l], S[5][l]);
        for (int c = 0; c < 3; ++c) S[c][l] -= shift;
      }
    for (int c = 0; c < 6; ++c) geometric[6 * q + c] = S[c];
  }
  if (slots) {
    V f[8][3];
    cornerForces(k, &h, f);
    scatterCorners<double>(f, slots);
  }
  if (state.energy) *reinterpret_cast<V*>(state.energy) = energy;
  if (state.dilatation) *reinterpret_cast<V*>(state.dilatation) = least;
}

void evaluateBatches(const HexBatches<double>& b, int begin, int end, const double* x,
                     HexState state, double* slots) {
  constexpr int kLanes = kHexLanes<double>;
  for (int k = begin; k < end; ++k) {
    const HexState here{
        state.energy ? state.energy + static_cast<long>(k) * kLanes : nullptr,
        state.dilatation ? state.dilatation + static_cast<long>(k) * kLanes : nullptr,
        state.stress ? state.stress + static_cast<long>(k) * kHexStress * kLanes : nullptr,
        state.positive};
    double* out = slots ? slots + 32L * kLanes * k : nullptr;
    if (k < b.boxes)
      evaluateBatch<true>(b, k, x, here, out);
    else
      evaluateBatch<false>(b, k, x, here, out);
  }
}

void stiffness(const HexBatches<float>& b, int batch, const float* x, const float* stress,
               float factor, const float* free, HexStiffness* out) {
  const float* s = stress + static_cast<long>(batch) * kHexStress * kHexLanes<float>;
  if (batch < b.boxes)
    stiffnessBatch<true>(b, batch, x, s, factor, free, out);
  else
    stiffnessBatch<false>(b, batch, x, s, factor, free, out);
}

extern const HexKernel kHexKernel = {evaluateBatches, multiplyBatches<double>,
                                     multiplyBatches<float>, stiffness};
