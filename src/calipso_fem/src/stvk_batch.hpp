#pragma once

// St. Venant-Kirchhoff hexahedra, four at a time (one per SIMD lane), plain or with the enhanced
// strain modes of enhanced_element.cpp. No Eigen types: compiled twice, with and without AVX2.
namespace calipso::fem {

constexpr int kLanes = 4;
constexpr int kPairs = 36;  // corner pairs a <= b, row by row

// What the lanes of a batch share.
struct StvkBatchKind {
  double gradient[8][8][3];   // [point][corner], 1/m
  double weight[8];           // m^3
  double mode[8][3][3];       // [point][k]: xi_k (j0/j) J0^-T e_k
  double mode_inverse[9][9];  // K_aa^-1
  double lambda, mu;          // Pa
  bool enhanced;
};

enum class StvkPart { kFull, kPositive, kMaterialOnly };

struct StvkBatchResult {
  alignas(32) double energy[kLanes];
  alignas(32) double smallest_dilatation[kLanes];  // least det F
  alignas(32) double f[24][kLanes];
  alignas(32) double K[kPairs][9][kLanes];  // rows of corner a, columns of corner b
};

// x: positions [3 corner + component][lane], m. derivatives: 0 energy, 1 also f, 2 also K.
// kPositive shifts the stress of the geometric stiffness by its least eigenvalue where negative.
void evaluateStvkBatch(const StvkBatchKind& kind, const double x[24][kLanes], int derivatives,
                       StvkPart part, StvkBatchResult* result);

namespace portable {
void evaluateStvkBatch(const StvkBatchKind& kind, const double x[24][kLanes], int derivatives,
                       StvkPart part, StvkBatchResult* result);
}
namespace avx2 {
void evaluateStvkBatch(const StvkBatchKind& kind, const double x[24][kLanes], int derivatives,
                       StvkPart part, StvkBatchResult* result);
}

}  // namespace calipso::fem
