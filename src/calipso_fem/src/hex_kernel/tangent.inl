// The tangent applied to a vector, batch by batch.

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
