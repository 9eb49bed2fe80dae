#include "prepare_remarks.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "texture/mesh_topology.hpp"

namespace calipso::render {
namespace {

constexpr double kMostInvented = 0.5, kMostCovered = 0.8;  // parts of the picture
constexpr double kMostClipped = 0.3;  // part of an object's pixels that is saturated or black
constexpr double kSaturated = 250.0, kBlack = 3.0;  // code values
constexpr double kLeastModelled = 0.7;              // part of a mask that the model must cover
constexpr double kManyHoles = 0.1;                  // of what is seen of an object
constexpr double kMuchUnseen = 0.25;                // part of an object's surface

int percent(double part) { return static_cast<int>(std::lround(100.0 * part)); }

double partOf(const cv::Mat& some, const cv::Mat& all) {
  const int count = cv::countNonZero(all);
  return count > 0 ? static_cast<double>(cv::countNonZero(some & all)) / count : 0.0;
}

// 255 where the actor's surface is drawn.
cv::Mat drawn(const Actor& actor, const cv::Size& size) {
  const VisibilityBuffer buffer({0, 0, size.width, size.height}, {&actor.screen});
  cv::Mat out = cv::Mat::zeros(size, CV_8U);
  for (int v = 0; v < size.height; ++v) {
    for (int u = 0; u < size.width; ++u)
      out.at<std::uint8_t>(v, u) = buffer.ids(v)[u] != VisibilityBuffer::kNothing ? 255 : 0;
  }
  return out;
}

// Part of the pixels that see an open surface which see the side of its piece that fewer do: through
// holes its inside is seen.
double seenThroughHoles(const Actor& actor, const Eigen::Vector3f& eye, const cv::Size& size) {
  if (actor.surface->winding != 0 || isSheet(actor.vertices, actor.surface->triangles)) return 0.0;
  const VisibilityBuffer buffer({0, 0, size.width, size.height}, {&actor.screen});
  const std::vector<int> parts = connectedParts(actor.vertices, actor.surface->triangles);
  std::map<int, std::array<int, 2>> sides;  // by part
  for (int v = 0; v < size.height; ++v) {
    for (int u = 0; u < size.width; ++u) {
      const std::uint32_t id = buffer.ids(v)[u];
      if (id == VisibilityBuffer::kNothing) continue;
      const int triangle = VisibilityBuffer::triangleOf(id);
      const Eigen::Vector3i& t = actor.surface->triangles[triangle];
      const Eigen::Vector3f &a = actor.vertices[t[0]], &b = actor.vertices[t[1]],
                            &c = actor.vertices[t[2]];
      ++sides[parts[triangle]][(b - a).cross(c - a).dot(eye - a) > 0.0f ? 1 : 0];
    }
  }
  int fewer = 0, all = 0;
  for (const auto& [part, seen] : sides)
    fewer += std::min(seen[0], seen[1]), all += seen[0] + seen[1];
  return static_cast<double>(fewer) / std::max(1, all);
}

void remarkPlace(const std::vector<ClipFrame>& frames, Prepared& p) {
  if (frames.size() == 1)
    p.remarks.push_back("the clip has one frame: all of the background is invented");
  const double invented = cv::mean(p.background.invented)[0] / 255.0,
               covered = cv::mean(p.key_labels != 0)[0] / 255.0;
  if (invented > kMostInvented) {
    p.remarks.push_back(
        std::to_string(percent(invented)) +
        " % of the background is hidden in every frame and was invented; check the strokes");
  }
  if (covered > kMostCovered) {
    p.remarks.push_back("the objects' masks cover " + std::to_string(percent(covered)) +
                        " % of the key frame: little is left to tell the place and its light by; "
                        "check the strokes");
  }
  if (p.background.drifting.untimed()) {
    p.remarks.push_back(
        "the background drifts, but the frames' stamps do not rise from one to the next: it is "
        "filled as if it did not; give the frames the times at which they were taken");
  }
  if (p.blank_frames > 0)
    p.remarks.push_back(std::to_string(p.blank_frames) + " of " +
                        std::to_string(p.blank_frames + frames.size()) +
                        " frames are mostly white or black: nothing was learnt from them, and they "
                        "are left as they are");
  if (!p.unseen_shade.empty())
    p.remarks.push_back(
        "something that no frame shows keeps the sun off a part of the place; it is taken to keep "
        "it off objects before that part, too, and before what is not seen as before the nearest "
        "part");
  if (!p.light.determined)
    p.remarks.push_back(
        "too little of the objects is seen to tell the light; it is assumed high and frontal");
  if (p.light.determined && !p.light.confirmed())
    p.remarks.push_back(
        "neither a cast shadow nor a highlight confirms the light's direction, which shading alone "
        "tells: it may be tens of degrees off; an edit 'light' sets it");
}

void remarkObject(const std::vector<ClipFrame>& frames, const Actor& actor, std::size_t i,
                  Prepared& p) {
  const Surface& s = p.surfaces[i];
  const std::string who = "object '" + s.name + "'";
  const cv::Mat mask = p.key_labels == s.index;
  if (cv::countNonZero(mask) == 0) {
    p.remarks.push_back(who + " is not seen in the key frame: its colour is unknown");
    return;
  }
  if (frames.size() > 1 && partOf(p.background.invented, mask) > 0.99) {
    p.remarks.push_back(who +
                        " hides the same place in every frame: what is behind it was invented");
  }
  cv::Mat grey;
  cv::cvtColor(frames.front().bgr, grey, cv::COLOR_BGR2GRAY);
  const double saturated = partOf(grey > kSaturated, mask), black = partOf(grey < kBlack, mask);
  if (std::max(saturated, black) > kMostClipped) {
    p.remarks.push_back(
        who + (saturated > black ? " is saturated in " : " is black in ") +
        std::to_string(percent(std::max(saturated, black))) +
        " % of its pixels: neither texture nor light can be told there; take another exposure");
  }
  const double modelled = partOf(drawn(actor, mask.size()), mask);
  if (modelled < kLeastModelled) {
    p.remarks.push_back(who + ": its model covers " + std::to_string(percent(modelled)) +
                        " % of its mask; the side that the camera sees is missing or misplaced, "
                        "and is left out when the object is drawn elsewhere");
  }
  const Eigen::Vector3f eye = p.camera.world_from_camera.translation().cast<float>();
  const double through = seenThroughHoles(actor, eye, mask.size());
  if (through > kManyHoles) {
    p.remarks.push_back(who + ": its model is open, and " + std::to_string(percent(through)) +
                        " % of what is seen of it is its inside; close the holes that the object "
                        "does not have");
  }
  const Appearance& a = p.appearances[i];
  if (p.light.determined && !p.light.toldGloss(i)) {
    p.remarks.push_back(
        who + ": no highlight of a confirmed light tells its gloss; it is " +
        (a.gloss.specular > 0.0f ? "what the shading leaves possible" : "taken to be matt") +
        ", an edit 'appearance' sets it");
  }
  const double unseen = 1.0 - a.seen_in_key - a.seen_elsewhere;
  if (unseen > kMuchUnseen) {
    p.remarks.push_back(who + ": " + std::to_string(percent(unseen)) +
                        " % of its surface is seen in no frame; " +
                        std::to_string(percent(a.copied)) +
                        " % was copied from like places, the rest continued smoothly");
  }
}

}  // namespace

void addRemarks(const std::vector<ClipFrame>& frames, const std::vector<Actor>& key_actors,
                Prepared& prepared) {
  remarkPlace(frames, prepared);
  for (std::size_t i = 0; i < prepared.surfaces.size(); ++i)
    remarkObject(frames, key_actors[i], i, prepared);
}

}  // namespace calipso::render
