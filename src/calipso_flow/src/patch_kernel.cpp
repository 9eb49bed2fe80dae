#include "patch_kernel.hpp"

#include <algorithm>

#include "calipso_scene/processor_clones.hpp"

namespace calipso::flow {

CALIPSO_CLONES
void sampleRows(const float* picture, long row, float fx, float fy, int side, float* out) {
  const float w00 = (1 - fx) * (1 - fy), w01 = fx * (1 - fy), w10 = (1 - fx) * fy, w11 = fx * fy;
  for (int j = 0; j < side; ++j) {
    const float* top = picture + j * row;
    const float* bottom = top + row;
    float* to = out + j * side;
#pragma omp simd
    for (int i = 0; i < side; ++i) {
      to[i] = w00 * top[i] + w01 * top[i + 1] + w10 * bottom[i] + w11 * bottom[i + 1];
    }
  }
}

CALIPSO_CLONES
PatchFill fillTerms(const float* values, const float* weights, int radius, int count,
                    PatchTerms& terms) {
  const int side = 2 * radius + 1, wide = side + 2;
  float support = 0.0f, sum = 0.0f;
  for (int j = 0; j < side; ++j) {
    const float* v = values + (j + 1) * wide + 1;
    const float* w = weights + (j + 1) * wide + 1;
    const int p = j * side;
#pragma omp simd reduction(+ : support, sum)
    for (int i = 0; i < side; ++i) {
      const float across = std::min(w[i - 1], w[i + 1]), down = std::min(w[i - wide], w[i + wide]);
      const float one = std::min(w[i], std::min(across, down)) < 0.99f ? 0.0f : 1.0f;
      terms.at[kGradientX][p + i] = one * 0.5f * (v[i + 1] - v[i - 1]);
      terms.at[kGradientY][p + i] = one * 0.5f * (v[i + wide] - v[i - wide]);
      terms.at[kValue][p + i] = one * v[i];
      terms.at[kOne][p + i] = one;
      terms.at[kRampX][p + i] = one * static_cast<float>(i - radius);
      terms.at[kRampY][p + i] = one * static_cast<float>(j - radius);
      support += one;
      sum += one * v[i];
    }
  }
  for (int a = 0; a < kTerms; ++a) std::fill(terms.at[a] + side * side, terms.at[a] + count, 0.0f);
  const float mean = support > 0.0f ? sum / support : 0.0f;
#pragma omp simd
  for (int p = 0; p < count; ++p) terms.at[kValue][p] -= mean * terms.at[kOne][p];
  return {support, sum};
}

CALIPSO_CLONES
void multiplyTerms(const PatchTerms& terms, int count, float sums[kTerms][kTerms]) {
  const float *x = terms.at[kGradientX], *y = terms.at[kGradientY], *v = terms.at[kValue],
              *o = terms.at[kOne], *rx = terms.at[kRampX], *ry = terms.at[kRampY];
  float xx = 0, xy = 0, yy = 0, xv = 0, yv = 0, xo = 0, yo = 0, xr = 0, yr = 0, xs = 0, ys = 0;
#pragma omp simd reduction(+ : xx, xy, yy, xv, yv, xo, yo, xr, yr, xs, ys)
  for (int p = 0; p < count; ++p) {
    xx += x[p] * x[p], xy += x[p] * y[p], yy += y[p] * y[p];
    xv += x[p] * v[p], yv += y[p] * v[p], xo += x[p], yo += y[p];
    xr += x[p] * rx[p], yr += y[p] * rx[p], xs += x[p] * ry[p], ys += y[p] * ry[p];
  }
  float vv = 0, vo = 0, vr = 0, vs = 0, oo = 0, orx = 0, ory = 0, rr = 0, rs = 0, ss = 0;
#pragma omp simd reduction(+ : vv, vo, vr, vs, oo, orx, ory, rr, rs, ss)
  for (int p = 0; p < count; ++p) {
    vv += v[p] * v[p], vo += v[p], vr += v[p] * rx[p], vs += v[p] * ry[p];
    oo += o[p], orx += rx[p], ory += ry[p];
    rr += rx[p] * rx[p], rs += rx[p] * ry[p], ss += ry[p] * ry[p];
  }
  const float upper[kTerms][kTerms] = {{xx, xy, xv, xo, xr, xs},  {xy, yy, yv, yo, yr, ys},
                                       {xv, yv, vv, vo, vr, vs},  {xo, yo, vo, oo, orx, ory},
                                       {xr, yr, vr, orx, rr, rs}, {xs, ys, vs, ory, rs, ss}};
  std::copy(&upper[0][0], &upper[0][0] + kTerms * kTerms, &sums[0][0]);
}

CALIPSO_CLONES
void multiplyTarget(const PatchTerms& terms, int count, float mean, const float* target,
                    float sums[kTerms + 1]) {
  const float *x = terms.at[kGradientX], *y = terms.at[kGradientY], *v = terms.at[kValue],
              *o = terms.at[kOne], *rx = terms.at[kRampX], *ry = terms.at[kRampY];
  float sx = 0, sy = 0, sv = 0, so = 0, sr = 0, ss = 0, squares = 0;
#pragma omp simd reduction(+ : sx, sy, sv, so, sr, ss, squares)
  for (int p = 0; p < count; ++p) {
    const float t = (target[p] - mean) * o[p];
    sx += x[p] * t, sy += y[p] * t, sv += v[p] * t, so += t;
    sr += rx[p] * t, ss += ry[p] * t, squares += t * t;
  }
  const float all[kTerms + 1] = {sx, sy, sv, so, sr, ss, squares};
  std::copy(all, all + kTerms + 1, sums);
}

}  // namespace calipso::flow
