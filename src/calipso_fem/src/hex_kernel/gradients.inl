// From corner values to the gradients at the eight Gauss points, and back. Point and corner q has the
// bits qx + 2 qy + 4 qz. Formulas: enhanced_element.cpp.

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
