#include "hex_level.hpp"

#include <algorithm>

namespace calipso::fem {
namespace {

constexpr int kFloatLanes = kHexLanes<float>;
constexpr int kDoubleLanes = kHexLanes<double>;

}  // namespace

void HexLevel::allocate(const StvkHexes& h) {
  hexes = &h;
  const std::size_t nodes = h.nodeCount();
  x.resize(4 * nodes);
  free.resize(4 * nodes);
  springs_.allocate(nodes);
  mass.resize(nodes);
  stress.resize(kHexStress * h.order().size());
  slots.resize(h.slotNumbers<float>());
}

void HexLevel::load(const AlignedBuffer<double>& at, const AlignedBuffer<double>& at_stress,
                    const HexSystem& system, const AlignedBuffer<double>& at_mass,
                    const std::vector<int>& fixed) {
  factor = static_cast<float>(1.0 + system.viscosity);
  std::fill(free.begin(), free.end(), 1.0f);
  for (std::size_t k = 3; k < free.size(); k += 4) free[k] = 0.0f;
  for (int dof : fixed) free[4L * hexes->nodeOf(dof / 3) + dof % 3] = 0.0f;
  springs_.set(system.springs);
  parallelFor(hexes->nodeCount(), 1024, [&](int begin, int end) {
    for (long k = 4L * begin; k < 4L * end; ++k) x[k] = static_cast<float>(at[k]);
    for (int i = begin; i < end; ++i) mass[i] = static_cast<float>(at_mass[i]);
  });
  // Two batches in double precision make one in single.
  parallelFor(hexes->batchCount<float>(), 32, [&](int begin, int end) {
    for (long batch = begin; batch < end; ++batch)
      for (int n = 0; n < kHexStress; ++n)
        for (int l = 0; l < kFloatLanes; ++l)
          stress[(batch * kHexStress + n) * kFloatLanes + l] = static_cast<float>(
              at_stress[((2 * batch + l / kDoubleLanes) * kHexStress + n) * kDoubleLanes +
                        l % kDoubleLanes]);
  });
}

}  // namespace calipso::fem
