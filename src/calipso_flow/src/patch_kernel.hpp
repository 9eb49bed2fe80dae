#pragma once

#include "calipso_flow/patch_match.hpp"

namespace calipso::flow {

// The sums over a patch's pixels on which Lucas-Kanade spends its time. Fixed order, so that the
// same pixels give the same bits; compiled for the processor's vector width besides the portable
// one.

constexpr int kPatchSide = 2 * kMostRadius + 1;
// Floats of one term, a whole number of vectors.
constexpr int kPatchStride = (kPatchSide * kPatchSide + 15) / 16 * 16;
constexpr int kWidePatch = (kPatchSide + 2) * (kPatchSide + 2);

enum Term { kGradientX, kGradientY, kValue, kOne, kRampX, kRampY, kTerms };

// Per pixel and term; 0 where the pixel does not count, and beyond the last pixel.
struct PatchTerms {
  alignas(64) float at[kTerms][kPatchStride];
};

// Bilinear values of the square of `side` pixels whose first pixel lies (fx, fy) in [0, 1) beyond
// `picture`.
// @param row  floats from one row of the picture to the next
void sampleRows(const float* picture, long row, float fx, float fy, int side, float* out);

// Fills the terms from grey values and weights of a square with one more ring than the patch, for
// central differences; a pixel counts when it and its four neighbours do.
// @param count  padded pixels
// @return the pixels that count, and the sum of their grey values
struct PatchFill {
  float support, sum;
};
PatchFill fillTerms(const float* values, const float* weights, int radius, int count,
                    PatchTerms& terms);

// sums[a][b] = sum over pixels of term a times term b, both halves.
void multiplyTerms(const PatchTerms& terms, int count, float sums[kTerms][kTerms]);

// Of the target less `mean`, where pixels count: sums of it times each term,
// and of its square.
void multiplyTarget(const PatchTerms& terms, int count, float mean, const float* target,
                    float sums[kTerms + 1]);

}  // namespace calipso::flow
