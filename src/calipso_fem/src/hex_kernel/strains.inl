// Strains, stresses and the enhanced modes at a point. Symmetric 3x3 tensors are stored as xx, yy, zz,
// xy, yz, zx. Formulas: enhanced_element.cpp.

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
