#include "frame/row_kinds.hpp"

#include <algorithm>

#include "draw/wide_loops.hpp"

namespace calipso::render {

RowKinds::RowKinds(const StagedFrame& frame, const Reflections& reflections,
                   const ShadedOthers& others, const DrawnSurfaces& surfaces,
                   const EdgeCoverage& edges, const PlaceLight& light, const StillPixels& still,
                   const Screen& screen, const cv::Mat& removed)
    : frame_(frame),
      reflections_(reflections),
      others_(others),
      surfaces_(surfaces),
      edges_(edges),
      light_(light),
      still_(still),
      screen_(screen),
      removed_(removed),
      region_(surfaces.centre().region()) {}

void RowKinds::find(int v, Kind* kinds) const {
  findSurfaces(v, kinds);
  if (!still_.none()) takeStill(v - region_.y, kinds);
  if (!screen_.levels().empty()) findScreened(v - region_.y, kinds);
  if (!reflections_.marks().empty()) findMirrored(v, kinds);
  if (others_.any()) findShadedOthers(v, kinds);
}

// Drawn surfaces, and what lies behind.
CALIPSO_WIDE_LOOPS void RowKinds::findSurfaces(int v, Kind* kinds) const {
  const int j = v - region_.y, width = region_.width;
  const std::uint8_t* drawn = surfaces_.mask().ptr<std::uint8_t>(j);
  const std::uint32_t* ids = surfaces_.centre().ids(j);
  for (int i = 0; i < width; ++i)
    reinterpret_cast<std::uint8_t*>(kinds)[i] = drawn[i] & static_cast<std::uint8_t>(kPlain);
  light_.relightable().visitRow(v, region_.x, region_.br().x, [&](int begin, int end) {
    findBehind(j, begin - region_.x, end - region_.x, kinds);
  });
  // What hides a surface at rest takes its residual.
  const bool all_drawn = surfaces_.isAllDrawn();
  for (int i = 0; !all_drawn && i < width; ++i)
    kinds[i] = kinds[i] == kBehind && ids[i] != VisibilityBuffer::kNothing ? kSpecial : kinds[i];
  edges_.visitRow(j, [kinds](int i, bool settled) {
    if (!settled)
      kinds[i] = kSpecial;
    else if (kinds[i] == kPlain)
      kinds[i] = kPlainEdge;
  });
}

// Of columns [begin, end) of region_'s row j: what lies behind, where its light changes or where
// it comes to light.
CALIPSO_WIDE_LOOPS void RowKinds::findBehind(int j, int begin, int end, Kind* kinds) const {
  const auto rowOf = [j](const cv::Mat& picture) { return picture.ptr<std::uint8_t>(j); };
  const std::uint8_t *sun = rowOf(light_.sun()), *sun_before = rowOf(light_.sunBefore()),
                     *sky = rowOf(light_.sky()), *sky_before = rowOf(light_.skyBefore());
  const std::uint8_t *labels = frame_.labels.ptr<std::uint8_t>(j + region_.y) + region_.x,
                     *takes = rowOf(light_.takes()), *removed = rowOf(removed_),
                     *relit = rowOf(light_.relit());
  std::uint8_t* out = reinterpret_cast<std::uint8_t*>(kinds);
  for (int i = begin; i < end; ++i) {
    const std::uint8_t sun_change =
        std::max(sun[i], sun_before[i]) - std::min(sun[i], sun_before[i]);
    const std::uint8_t sky_change =
        std::max(sky[i], sky_before[i]) - std::min(sky[i], sky_before[i]);
    const std::uint8_t change =
        std::min<std::uint8_t>(sun_change, 100) + std::min<std::uint8_t>(sky_change, 100);
    const std::uint8_t differs =
        ((relit[i] != 0) | (change >= kSameLevels)) & (takes[i] != 0) & (labels[i] == 0);
    const std::uint8_t behind = (differs | (removed[i] != 0)) != 0 ? kBehind : kNone;
    out[i] = out[i] == kNone ? behind : out[i];
  }
}

// A surface that rests needs nothing where it is seen in the video, but its rim may.
CALIPSO_WIDE_LOOPS void RowKinds::takeStill(int j, Kind* kinds) const {
  const float* still = still_.row(j);
  const std::uint8_t* removed = removed_.ptr<std::uint8_t>(j);
  for (int i = 0; i < region_.width; ++i) {
    if (still[i] >= StillPixels::kKept && kinds[i] != kNone)
      kinds[i] = removed[i] != 0 ? kNone : isPlain(kinds[i]) ? kSpecial : kinds[i];
    else if (kinds[i] == kNone && still_.isRelit(i, j))
      kinds[i] = kBehind;
  }
}

CALIPSO_WIDE_LOOPS void RowKinds::findScreened(int j, Kind* kinds) const {
  const std::uint8_t* screened = screen_.levels().ptr<std::uint8_t>(j);
  for (int i = 0; i < region_.width; ++i)
    kinds[i] = screened[i] != 0 && isPlain(kinds[i]) ? kSpecial : kinds[i];
}

CALIPSO_WIDE_LOOPS void RowKinds::findMirrored(int v, Kind* kinds) const {
  const std::uint8_t *marks = reflections_.marks().ptr<std::uint8_t>(v) + region_.x,
                     *labels = frame_.labels.ptr<std::uint8_t>(v) + region_.x;
  for (int i = 0; i < region_.width; ++i)
    kinds[i] = marks[i] == Reflections::kChanged && kinds[i] == kNone && labels[i] == 0 ? kBehind
                                                                                        : kinds[i];
}

CALIPSO_WIDE_LOOPS void RowKinds::findShadedOthers(int v, Kind* kinds) const {
  const int j = v - region_.y;
  const std::uint32_t* ids = surfaces_.centre().ids(j);
  const std::uint8_t *labels = frame_.labels.ptr<std::uint8_t>(v) + region_.x,
                     *drawn = surfaces_.mask().ptr<std::uint8_t>(j),
                     *removed = removed_.ptr<std::uint8_t>(j);
  for (int i = 0; i < region_.width; ++i) {
    const bool other = ids[i] != VisibilityBuffer::kNothing && drawn[i] == 0;
    if (other && labels[i] != 0 && removed[i] == 0 && kinds[i] != kSpecial) kinds[i] = kSpecial;
  }
}

}  // namespace calipso::render
