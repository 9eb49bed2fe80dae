// Included by stvk_batch_portable.cpp and stvk_batch_avx2.cpp inside their namespaces.
// Symmetric 3x3 tensors are stored as xx, yy, zz, xy, yz, zx. Formulas: enhanced_element.cpp.

typedef double Lane __attribute__((vector_size(32)));

struct Symmetric {
  Lane v[6];
};

inline Lane zero() { return Lane{0.0, 0.0, 0.0, 0.0}; }

// S_c: row c of S times b.
inline void multiply(const Symmetric& S, const Lane b[3], Lane out[3]) {
  out[0] = S.v[0] * b[0] + S.v[3] * b[1] + S.v[5] * b[2];
  out[1] = S.v[3] * b[0] + S.v[1] * b[1] + S.v[4] * b[2];
  out[2] = S.v[5] * b[0] + S.v[4] * b[1] + S.v[2] * b[2];
}

inline Symmetric hooke(double lambda, double mu, const Symmetric& E) {
  const Lane pressure = lambda * (E.v[0] + E.v[1] + E.v[2]);
  Symmetric S;
  for (int c = 0; c < 6; ++c) S.v[c] = 2.0 * mu * E.v[c];
  for (int c = 0; c < 3; ++c) S.v[c] += pressure;
  return S;
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

inline void shiftPositive(Symmetric* S) {
  for (int l = 0; l < kLanes; ++l) {
    const double shift =
        negativeEigenvalue(S->v[0][l], S->v[1][l], S->v[2][l], S->v[3][l], S->v[4][l], S->v[5][l]);
    for (int c = 0; c < 3; ++c) S->v[c][l] -= shift;
  }
}

struct Point {
  Lane F[3][3];
  Symmetric E, B;  // Green strain; F F^T
};

struct Work {
  Point point[8];
  Lane coupling[24][9];  // K_xa
};

inline Lane evaluatePoint(const StvkBatchKind& kind, int q, const double x[24][kLanes], Point* p) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) p->F[i][j] = zero();
  for (int a = 0; a < 8; ++a)
    for (int i = 0; i < 3; ++i) {
      const Lane xi = *reinterpret_cast<const Lane*>(x[3 * a + i]);
      for (int j = 0; j < 3; ++j) p->F[i][j] += xi * kind.gradient[q][a][j];
    }
  const int row[6] = {0, 1, 2, 0, 1, 2}, column[6] = {0, 1, 2, 1, 2, 0};
  const auto& F = p->F;
  for (int c = 0; c < 6; ++c) {
    const int i = row[c], j = column[c];
    const double one = c < 3 ? 1.0 : 0.0;
    p->E.v[c] = 0.5 * (F[0][i] * F[0][j] + F[1][i] * F[1][j] + F[2][i] * F[2][j] - one);
    p->B.v[c] = F[i][0] * F[j][0] + F[i][1] * F[j][1] + F[i][2] * F[j][2];
  }
  return F[0][0] * (F[1][1] * F[2][2] - F[1][2] * F[2][1]) -
         F[0][1] * (F[1][0] * F[2][2] - F[1][2] * F[2][0]) +
         F[0][2] * (F[1][0] * F[2][1] - F[1][1] * F[2][0]);
}

// Adds the condensed enhanced strains to those of the points.
inline void enhanceStrains(const StvkBatchKind& kind, Point* points) {
  Lane load[9];
  for (Lane& l : load) l = zero();
  for (int q = 0; q < 8; ++q) {
    const Symmetric S = hooke(kind.lambda, kind.mu, points[q].E);
    for (int k = 0; k < 3; ++k) {
      Lane m[3], Sm[3];
      for (int c = 0; c < 3; ++c) m[c] = zero() + kind.weight[q] * kind.mode[q][k][c];
      multiply(S, m, Sm);
      for (int c = 0; c < 3; ++c) load[3 * k + c] += Sm[c];
    }
  }
  Lane a[9];
  for (int i = 0; i < 9; ++i) {
    a[i] = zero();
    for (int j = 0; j < 9; ++j) a[i] -= kind.mode_inverse[i][j] * load[j];
  }
  for (int q = 0; q < 8; ++q)
    for (int k = 0; k < 3; ++k) {
      const double* m = kind.mode[q][k];
      const Lane* ak = a + 3 * k;
      Lane* E = points[q].E.v;
      for (int c = 0; c < 3; ++c) E[c] += ak[c] * m[c];
      E[3] += 0.5 * (ak[0] * m[1] + ak[1] * m[0]);
      E[4] += 0.5 * (ak[1] * m[2] + ak[2] * m[1]);
      E[5] += 0.5 * (ak[2] * m[0] + ak[0] * m[2]);
    }
}

// K_ab += w (lambda p_a p_b^T + mu p_b p_a^T + mu (g_a.g_b) B + (g_a.S g_b) I)
inline void addStiffness(const StvkBatchKind& kind, int q, const Point& point, const Symmetric& S,
                         const Lane p[8][3], Lane (*K)[9]) {
  const double w = kind.weight[q];
  const Lane* v = point.B.v;
  const Lane B[9] = {v[0], v[3], v[5], v[3], v[1], v[4], v[5], v[4], v[2]};
  int pair = 0;
  for (int a = 0; a < 8; ++a) {
    const double* ga = kind.gradient[q][a];
    Lane lp[3], mp[3], Sg[3], g[3];
    for (int c = 0; c < 3; ++c) {
      lp[c] = w * kind.lambda * p[a][c];
      mp[c] = w * kind.mu * p[a][c];
      g[c] = zero() + w * ga[c];
    }
    multiply(S, g, Sg);
    for (int b = a; b < 8; ++b, ++pair) {
      const double* gb = kind.gradient[q][b];
      const double gg = w * kind.mu * (ga[0] * gb[0] + ga[1] * gb[1] + ga[2] * gb[2]);
      const Lane geometric = Sg[0] * gb[0] + Sg[1] * gb[1] + Sg[2] * gb[2];
      Lane* k = K[pair];
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
          k[3 * i + j] += lp[i] * p[b][j] + mp[j] * p[b][i] + gg * B[3 * i + j];
      k[0] += geometric;
      k[4] += geometric;
      k[8] += geometric;
    }
  }
}

// Coupling of mode 3 k + c: w (mu (F_c (m_k.g_a) + (F m_k) g_ac) + lambda m_kc p_a)
inline void addCoupling(const StvkBatchKind& kind, int q, const Point& point, const Lane p[8][3],
                        Lane (*C)[9]) {
  const auto& F = point.F;
  for (int k = 0; k < 3; ++k) {
    double m[3];
    for (int c = 0; c < 3; ++c) m[c] = kind.weight[q] * kind.mode[q][k][c];
    Lane Fm[3];
    for (int i = 0; i < 3; ++i)
      Fm[i] = kind.mu * (F[i][0] * m[0] + F[i][1] * m[1] + F[i][2] * m[2]);
    for (int a = 0; a < 8; ++a) {
      const double* g = kind.gradient[q][a];
      const double mg = kind.mu * (m[0] * g[0] + m[1] * g[1] + m[2] * g[2]);
      for (int i = 0; i < 3; ++i)
        for (int c = 0; c < 3; ++c)
          C[3 * a + i][3 * k + c] += F[i][c] * mg + Fm[i] * g[c] + kind.lambda * m[c] * p[a][i];
    }
  }
}

// K -= C K_aa^-1 C^T
inline void condense(const StvkBatchKind& kind, const Lane (*C)[9], Lane (*K)[9]) {
  Lane D[24][9];
  for (int r = 0; r < 24; ++r)
    for (int j = 0; j < 9; ++j) {
      Lane sum = zero();
      for (int i = 0; i < 9; ++i) sum += C[r][i] * kind.mode_inverse[i][j];
      D[r][j] = sum;
    }
  int pair = 0;
  for (int a = 0; a < 8; ++a)
    for (int b = a; b < 8; ++b, ++pair)
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
          Lane sum = zero();
          for (int m = 0; m < 9; ++m) sum += D[3 * a + i][m] * C[3 * b + j][m];
          K[pair][3 * i + j] -= sum;
        }
}

void evaluateStvkBatch(const StvkBatchKind& kind, const double x[24][kLanes], int derivatives,
                       StvkPart part, StvkBatchResult* result) {
  Work work;
  Lane least = zero() + 1e300, energy = zero();
  for (int q = 0; q < 8; ++q) {
    const Lane J = evaluatePoint(kind, q, x, &work.point[q]);
    least = J < least ? J : least;
  }
  if (kind.enhanced) enhanceStrains(kind, work.point);
  auto* f = reinterpret_cast<Lane*>(result->f);
  auto* K = reinterpret_cast<Lane(*)[9]>(result->K);
  if (derivatives > 0)
    for (int i = 0; i < 24; ++i) f[i] = zero();
  if (derivatives > 1)
    for (int i = 0; i < kPairs; ++i)
      for (int j = 0; j < 9; ++j) K[i][j] = zero();
  if (derivatives > 1 && kind.enhanced)
    for (auto& row : work.coupling)
      for (Lane& entry : row) entry = zero();
  for (int q = 0; q < 8; ++q) {
    const Point& point = work.point[q];
    Symmetric S = hooke(kind.lambda, kind.mu, point.E);
    const Lane* e = point.E.v;
    energy += 0.5 * kind.weight[q] *
              (S.v[0] * e[0] + S.v[1] * e[1] + S.v[2] * e[2] +
               2.0 * (S.v[3] * e[3] + S.v[4] * e[4] + S.v[5] * e[5]));
    if (derivatives < 1) continue;
    Lane p[8][3];
    for (int a = 0; a < 8; ++a) {
      const double* g = kind.gradient[q][a];
      for (int i = 0; i < 3; ++i)
        p[a][i] = point.F[i][0] * g[0] + point.F[i][1] * g[1] + point.F[i][2] * g[2];
      Lane wg[3], Sg[3];
      for (int c = 0; c < 3; ++c) wg[c] = zero() + kind.weight[q] * g[c];
      multiply(S, wg, Sg);
      for (int i = 0; i < 3; ++i)
        f[3 * a + i] += point.F[i][0] * Sg[0] + point.F[i][1] * Sg[1] + point.F[i][2] * Sg[2];
    }
    if (derivatives < 2) continue;
    if (part == StvkPart::kPositive) shiftPositive(&S);
    if (part == StvkPart::kMaterialOnly)
      for (Lane& entry : S.v) entry = zero();
    addStiffness(kind, q, point, S, p, K);
    if (kind.enhanced) addCoupling(kind, q, point, p, work.coupling);
  }
  if (derivatives > 1 && kind.enhanced) condense(kind, work.coupling, K);
  *reinterpret_cast<Lane*>(result->energy) = energy;
  *reinterpret_cast<Lane*>(result->smallest_dilatation) = least;
}
