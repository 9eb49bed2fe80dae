#include "dense_kernels.hpp"

#include "calipso_scene/processor_clones.hpp"

namespace calipso::fem {

CALIPSO_CLONES
void addThree(const double* __restrict x, long stride, const double a[3], int n,
              double* __restrict y) {
  const double *x1 = x + stride, *x2 = x + 2 * stride;
  const double a0 = a[0], a1 = a[1], a2 = a[2];
  for (int i = 0; i < n; ++i) y[i] += a0 * x[i] + a1 * x1[i] + a2 * x2[i];
}

CALIPSO_CLONES
void projectOnto(const PlaceList& places, int count, const double* __restrict columns,
                 double* __restrict out) {
  for (int j = 0; j < count; ++j, out += 9) {
    double sum[9] = {0, 0, 0, 0, 0, 0, 0, 0, 0};
    for (int k = places.start[j]; k < places.start[j + 1]; ++k) {
      const double* block = columns + 9 * places.node[k];
      const double w = places.weight[k];
      for (int c = 0; c < 9; ++c) sum[c] += w * block[c];
    }
    const double* F = places.frames + 9 * j;
    for (int c = 0; c < 3; ++c)
      for (int r = 0; r < 3; ++r)
        out[3 * c + r] = sum[r] * F[c] + sum[3 + r] * F[3 + c] + sum[6 + r] * F[6 + c];
  }
}

}  // namespace calipso::fem
