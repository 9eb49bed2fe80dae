// Energy, forces and stresses at a state, batch by batch.

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
