// Included by hex_kernel_*.cpp inside their namespaces.

// clang-format off: each builds upon those before it
#include "lanes.inl"
#include "gradients.inl"
#include "strains.inl"
#include "tangent.inl"
#include "stiffness.inl"
#include "energy.inl"
// clang-format on

extern const HexKernel kHexKernel = {evaluateBatches, multiplyBatches<double>,
                                     multiplyBatches<float>, stiffness};
