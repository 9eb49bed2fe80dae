#include "texture/like_places.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include "smooth_step.hpp"
#include "texture/mesh_topology.hpp"

namespace calipso::render {
namespace {

constexpr float kQuarter = 0.25f * static_cast<float>(M_PI);
// rad: middles of the part of a body of revolution that others repeat, the first of them; then in
// steps, up to which, as the pattern may repeat itself about some of them alone
constexpr float kTurns[] = {0.0f, 0.5f, -0.5f};
constexpr float kTurnStep = 0.05f, kFarthestTurn = 0.7f;
constexpr int kMostParts = 24;  // equal ones, into which a pattern may divide a turn
constexpr float kApart = 3.0f;  // spacings of texels: places nearer to each other tell nothing
constexpr int kFewest = 30;     // places that tell whether others are like them
// difference of two colours, of the brighter one, that light explains, and that none does
constexpr float kSameColour = 0.15f, kOtherColour = 0.35f;
// part of the places that look otherwise, from which the likeness comes later, and last
constexpr float kSomeDiffer = 0.15f, kTooManyDiffer = 0.5f;
// where a likeness that nothing tells of ranks: after all that agree well
constexpr float kUnjudged = 0.5f;
constexpr float kSameBox = 0.05f;  // of the extent: parts are mirror images of each other

// Turns places about an axis into the quarter of a turn on either side of `middle`, back and forth,
// so that what is near each other stays so.
struct Fold {
  Axis axis;
  Eigen::Vector3f ahead, aside;  // span the plane across the axis; `ahead` is the middle

  Place operator()(const Place& place) const {
    const Eigen::Vector3f arm = place.point - axis.point;
    const float angle = std::atan2(arm.dot(aside), arm.dot(ahead));
    const float turns =
        angle / (4.0f * kQuarter) + 0.25f;  // whole numbers where the sense changes back
    const float phase = turns - std::floor(turns);
    const bool back = phase > 0.5f;
    const float folded = 4.0f * kQuarter * ((back ? 1.0f - phase : phase) - 0.25f);
    if (!back) return turned(place, folded - angle);
    // The mirror image across the plane through the axis that maps the one angle to the other.
    const float half = 0.5f * (angle + folded);
    const Eigen::Vector3f across = std::cos(half) * aside - std::sin(half) * ahead;
    const MirrorPlane plane{across, across.dot(axis.point)};
    return {plane.point(place.point), plane.vector(place.normal), place.part, place.piece,
            place.open};
  }

 private:
  Place turned(const Place& place, float angle) const {
    const Eigen::AngleAxisf rotation(angle, axis.direction);
    return {axis.point + rotation * (place.point - axis.point), rotation * place.normal, place.part,
            place.piece, place.open};
  }
};

// Turns places about an axis by whole parts of a turn, to within half of one from the plane that
// `ahead` spans with the axis.
struct Repeat {
  Axis axis;
  Eigen::Vector3f ahead, aside;
  float part;  // rad

  Place operator()(const Place& place) const {
    const Eigen::Vector3f arm = place.point - axis.point;
    const float angle = std::atan2(arm.dot(aside), arm.dot(ahead));
    const Eigen::AngleAxisf back(-part * std::round(angle / part), axis.direction);
    return {axis.point + back * arm, back * place.normal, place.part, place.piece, place.open};
  }
};

using PartBoxes = std::map<int, Eigen::AlignedBox3f>;

template <typename Map>
PartBoxes boxesOf(const Points& vertices, const Triangles& triangles, const std::vector<int>& parts,
                  const Map& map) {
  PartBoxes boxes;
  for (std::size_t t = 0; t < parts.size(); ++t) {
    for (int k = 0; k < 3; ++k) boxes[parts[t]].extend(map(vertices[triangles[t][k]]));
  }
  return boxes;
}

// Which part each of them has as its mirror image: the one whose bounding box comes nearest, if it
// comes near. Parts smaller than that are not told apart.
std::map<int, int> mirroredParts(const PartBoxes& boxes, const PartBoxes& mirrored, float apart) {
  std::map<int, int> images;
  std::vector<std::pair<int, Eigen::AlignedBox3f>> large;
  for (const auto& entry : boxes)
    if (entry.second.diagonal().norm() >= apart) large.push_back(entry);
  for (const auto& [part, image] : mirrored) {
    float least = apart;
    if (image.diagonal().norm() < apart) continue;
    for (const auto& [other, box] : large) {
      const float off = (box.min() - image.min()).norm() + (box.max() - image.max()).norm();
      if (off < least) least = off, images[part] = other;
    }
  }
  return images;
}

}  // namespace

std::vector<LikePlace> mirroredPlaces(const std::vector<MirrorPlane>& planes,
                                      const Points& vertices, const Triangles& triangles,
                                      const std::vector<int>& parts) {
  const PartBoxes boxes =
      boxesOf(vertices, triangles, parts, [](const Eigen::Vector3f& p) { return p; });
  const float apart = kSameBox * boxOf(vertices).diagonal().norm();
  std::vector<LikePlace> like;
  for (const MirrorPlane& plane : planes) {
    const PartBoxes mirrored = boxesOf(vertices, triangles, parts,
                                       [&](const Eigen::Vector3f& p) { return plane.point(p); });
    like.push_back({[plane, images = mirroredParts(boxes, mirrored, apart)](const Place& place) {
                      const auto image = images.find(place.part);
                      return Place{plane.point(place.point), plane.vector(place.normal),
                                   image == images.end() ? kAnyPart : image->second, kAnyPart,
                                   place.open};
                    },
                    std::nullopt});
  }
  return like;
}

std::vector<LikePlace> turnedPlaces(const Points& vertices, const Triangles& triangles,
                                    const Eigen::Vector3f& eye) {
  std::vector<LikePlace> like;
  const auto axis = revolutionAxis(vertices, triangles);
  if (!axis) return like;
  const Eigen::Vector3f to_eye = eye - axis->point;
  const Eigen::Vector3f ahead =
      (to_eye - axis->direction * axis->direction.dot(to_eye)).normalized();
  if (!ahead.allFinite() || ahead.isZero()) return like;
  std::vector<float> turns(std::begin(kTurns), std::end(kTurns));
  for (float turn = kTurnStep; turn <= kFarthestTurn; turn += kTurnStep)
    turns.insert(turns.end(), {turn, -turn});
  for (const float turn : turns) {
    const Eigen::Vector3f middle = Eigen::AngleAxisf(turn, axis->direction) * ahead;
    like.push_back({Fold{*axis, middle, axis->direction.cross(middle)}, std::nullopt});
  }
  const Eigen::Vector3f aside = axis->direction.cross(ahead);
  for (int parts = 2; parts <= kMostParts; ++parts)
    like.push_back(
        {Repeat{*axis, ahead, aside, 8.0f * kQuarter / static_cast<float>(parts)}, std::nullopt});
  return like;
}

void judgeLikePlaces(const std::vector<KnownPlace>& known, float spacing,
                     const std::function<std::optional<cv::Vec3f>(const Place&)>& colourAt,
                     std::vector<LikePlace>& like) {
  const int count = static_cast<int>(like.size());
#pragma omp parallel for schedule(dynamic, 1)
  for (int i = 0; i < count; ++i) {
    float differ = 0.0f;
    int told = 0;
    for (const KnownPlace& k : known) {
      const Place there = like[i].of(k.place);
      if ((there.point - k.place.point).norm() < kApart * spacing) continue;
      const std::optional<cv::Vec3f> colour = colourAt(there);
      if (!colour) continue;
      const double more = std::max({cv::norm(k.colour), cv::norm(*colour), 1e-6});
      differ += smoothStep(kSameColour, kOtherColour,
                           static_cast<float>(cv::norm(k.colour - *colour) / more));
      ++told;
    }
    if (told >= kFewest)
      like[i].agrees = 1.0f - smoothStep(kSomeDiffer, kTooManyDiffer, differ / told);
  }
}

std::vector<LikePlace> bestFirst(std::vector<LikePlace> mirrored, std::vector<LikePlace> turned,
                                 std::size_t most_turned) {
  const auto sort = [](std::vector<LikePlace>& like) {
    const auto order = [](const LikePlace& l) {
      return !l.agrees ? kUnjudged : l.agreesWell() ? *l.agrees : 0.0f;
    };
    std::stable_sort(like.begin(), like.end(),
                     [&](const LikePlace& a, const LikePlace& b) { return order(a) > order(b); });
  };
  sort(turned);
  turned.resize(std::min(turned.size(), most_turned));
  mirrored.insert(mirrored.end(), turned.begin(), turned.end());
  sort(mirrored);
  return mirrored;
}

}  // namespace calipso::render
