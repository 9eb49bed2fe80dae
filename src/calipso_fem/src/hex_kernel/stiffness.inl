// Stiffness matrices of a batch, held nodes masked out, and what of them a coarser grid needs.

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

void stiffness(const HexBatches<float>& b, int batch, const float* x, const float* stress,
               float factor, const float* free, HexStiffness* out) {
  const float* s = stress + static_cast<long>(batch) * kHexStress * kHexLanes<float>;
  if (batch < b.boxes)
    stiffnessBatch<true>(b, batch, x, s, factor, free, out);
  else
    stiffnessBatch<false>(b, batch, x, s, factor, free, out);
}
