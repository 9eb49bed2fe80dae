// The part of FrameCompositor that carries over what drawing misses: the video's pixels around an
// object at rest, less the same pixels drawn, move along with it. Unmoved, the drawn object is the
// video again, grain and all.

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "calipso_render/colour.hpp"
#include "frame/frame_compositor.hpp"
#include "place/view_warp.hpp"

namespace calipso::render {
namespace {

constexpr float kWholePx = 0.5f;  // movement up to which the residual goes along

// ... of what sways in the video: what is missed is how it did
constexpr float kWholeSwaying = 0.05f, kNoneSwaying = 0.3f;

// factor: what is missed by more, where a surface has moved, is misfit and not its look
constexpr float kMostChange = 3.0f;

// px around surfaces at rest in which their rims and what they take over lie
constexpr int kCarried = 16;

constexpr float kDark = 1e-5f;  // linear; a plate darker than that says nothing of its shadow

// For every pixel the nearest one of a set.
struct Nearest {
  cv::Mat labels;
  std::vector<cv::Point> place;  // per label; empty: the set is empty
  cv::Point at(int v, int u) const { return place[labels.at<int>(v, u)]; }
};

Nearest nearestWhere(const cv::Mat& set) {
  Nearest nearest;
  if (cv::countNonZero(set) == 0) return nearest;
  cv::Mat distance;
  cv::distanceTransform(set == 0, distance, nearest.labels, cv::DIST_L2, cv::DIST_MASK_5,
                        cv::DIST_LABEL_PIXEL);
  for (int v = 0; v < set.rows; ++v) {
    for (int u = 0; u < set.cols; ++u) {
      if (set.at<std::uint8_t>(v, u) == 0) continue;
      const std::size_t label = static_cast<std::size_t>(nearest.labels.at<int>(v, u));
      if (nearest.place.size() <= label) nearest.place.resize(label + 1);
      nearest.place[label] = {u, v};
    }
  }
  return nearest;
}

FrameInput frameAtRest(const Prepared& prepared, const std::vector<bool>& edited) {
  FrameInput input;
  prepared.background.plate.convertTo(input.bgr, CV_8U);
  input.labels = prepared.key_labels;
  input.camera = prepared.camera, input.stamp_ns = prepared.key_stamp_ns;
  for (std::size_t i = 0; i < edited.size(); ++i) {
    if (!edited[i]) continue;
    ObjectInFrame o;
    o.name = prepared.surfaces[i].name, o.edited = true,
    o.vertices = prepared.surfaces[i].key_vertices;
    input.objects.push_back(o);
  }
  return input;
}

}  // namespace

// The objects in question drawn where the video has them, from what was prepared alone.
RestPicture FrameCompositor::restPicture(const Prepared& prepared, const RenderParams& params,
                                         const std::vector<bool>& edited) {
  const FrameInput input = frameAtRest(prepared, edited);
  RenderParams plain = params;
  plain.add_noise = plain.keep_still = plain.carry_residual = false;
  ShadowCache shadows;
  RestPicture none;
  FrameCompositor rest(prepared, plain, input, shadows, none);
  rest.prepareFrame();
  RestPicture picture{edited,
                      cv::Mat(input.bgr.size(), CV_32FC3, cv::Scalar::all(-1)),
                      cv::Mat::zeros(input.bgr.size(), CV_32FC3),
                      cv::Mat(input.bgr.size(), CV_16S, cv::Scalar(-1)),
                      cv::Mat::zeros(input.bgr.size(), CV_8U),
                      {}};
  const cv::Rect& r = rest.region_;
  if (r.empty()) return picture;
#pragma omp parallel
  {
    Row row;
#pragma omp for schedule(dynamic, 8)
    for (int v = r.y; v < r.y + r.height; ++v) rest.recordRow(v, row, picture);
  }
  rest.recordOwners(picture);
  return picture;
}

// The nearest object of every pixel, and how far what is missed can reach.
void FrameCompositor::recordOwners(RestPicture& picture) const {
  const cv::Rect& r = region_;
  cv::Mat owners(r.size(), CV_16S, cv::Scalar(-1));
  for (int v = 0; v < r.height; ++v) {
    for (int u = 0; u < r.width; ++u) {
      const std::uint32_t id = centre_->ids(v)[u];
      if (id != VisibilityBuffer::kNothing)
        owners.at<short>(v, u) = static_cast<short>(frame_.objectOf(id).surface);
    }
  }
  const Nearest nearest = nearestWhere(owners >= 0);
  if (nearest.place.empty()) return;
  cv::dilate(removed_, picture.reach(r), disc(static_cast<int>(kNonePx)));
  picture.box = cv::boundingRect(removed_) + r.tl();
  cv::Mat out = picture.owners(r);
  for (int v = 0; v < r.height; ++v) {
    for (int u = 0; u < r.width; ++u) out.at<short>(v, u) = owners.at<short>(nearest.at(v, u));
  }
}

// Row v of what is drawn and of what passes beside it.
void FrameCompositor::recordRow(int v, Row& row, RestPicture& picture) const {
  row.resize(region_.width);
  drawRow(v, row);
  for (int i = 0; i < region_.width; ++i) {
    const int u = i + region_.x;
    if (removed_.at<std::uint8_t>(v - region_.y, i) == 0) continue;
    const cv::Vec4f plain = row.at(i);
    Drawn drawn;
    if (isPlain(row.kinds[i]))
      drawn = {{plain[0], plain[1], plain[2]}, 1.0f};
    else if (row.kinds[i] == kSpecial)
      drawn = row.drawn[i];
    picture.drawn.at<cv::Vec3f>(v, u) = drawn.cover * drawn.colour;
    if (drawn.cover == 1.0f) continue;
    const cv::Vec3f behind = behindAt(u, v).colour, revealed = revealedAt(u, v).colour;
    for (int c = 0; c < 3; ++c)
      picture.passing.at<cv::Vec3f>(v, u)[c] =
          (1.0f - drawn.cover) * (revealed[c] > kDark ? behind[c] / revealed[c] : 1.0f);
  }
}

void FrameCompositor::findResidual() {
  if (!frame_.params.carry_residual || !frame_.at_key_camera) return;
  const auto rests = [](const StagedObject& o) { return o.isAtRestInVideo(); };
  if (std::none_of(frame_.objects.begin(), frame_.objects.end(), rests)) return;
  std::vector<bool> resting(frame_.edited.size());
  for (std::size_t i = 0; i < frame_.edited.size(); ++i)
    resting[i] = frame_.edited[i] && frame_.at_rest[i];
  if (rest_.edited != resting) rest_ = restPicture(frame_.prepared, frame_.params, resting);
  const cv::Rect carried = carriedBox();
  if (carried.empty()) return;
  findMiss(carried);
  findRims(carried);
}

// Pixels that take something over: those of triangles with a point that moved little, and their
// surroundings.
cv::Rect FrameCompositor::carriedBox() const {
  cv::Rect carried;
  for (std::size_t slot = 0; slot < frame_.objects.size(); ++slot) {
    if (!frame_.objects[slot].isAtRestInVideo()) continue;
    const Points &now = frame_.objects[slot].actor.screen.points,
                 &then = frame_.objects[slot].observed.points;
    const Triangles& triangles = frame_.objects[slot].actor.surface->triangles;
    float left = 1e9f, top = 1e9f, right = -1e9f, bottom = -1e9f;
#pragma omp parallel for schedule(static) reduction(min : left, top) reduction(max : right, bottom)
    for (std::size_t k = 0; k < triangles.size(); ++k) {
      if (!mayMoveLess(now, then, triangles[k], kNonePx)) continue;
      for (int i = 0; i < 3; ++i) {
        const Eigen::Vector3f& p = now[triangles[k][i]];
        left = std::min(left, p.x()), right = std::max(right, p.x());
        top = std::min(top, p.y()), bottom = std::max(bottom, p.y());
      }
    }
    if (!(left <= right && top <= bottom)) continue;
    const auto pixel = [](float x) { return static_cast<int>(std::clamp(x, -1.0f, 1e6f)); };
    carried |= cv::Rect(cv::Point(pixel(left) - kCarried, pixel(top) - kCarried),
                        cv::Point(pixel(right) + kCarried + 1, pixel(bottom) + kCarried + 1));
  }
  return carried & region_;
}

// @param carried pixels that may take over what is missed
void FrameCompositor::findMiss(const cv::Rect& carried) {
  miss_box_ = cv::Rect(carried.x - kCarried, carried.y - kCarried, carried.width + 2 * kCarried,
                       carried.height + 2 * kCarried) &
              rest_.box;
  const cv::Rect box = miss_box_;
  if (box.empty()) return;
  miss_ = cv::Mat(box.size(), CV_32FC4);
#pragma omp parallel for schedule(static)
  for (int j = 0; j < box.height; ++j) {
    const int v = box.y + j;
    const cv::Vec3b* codes = frame_.input.bgr.ptr<cv::Vec3b>(v) + box.x;
    const cv::Vec3f *drawn = rest_.drawn.ptr<cv::Vec3f>(v) + box.x,
                    *passing = rest_.passing.ptr<cv::Vec3f>(v) + box.x;
    cv::Vec4f* miss = miss_.ptr<cv::Vec4f>(j);
    for (int i = 0; i < box.width; ++i) {
      if (drawn[i][0] < 0.0f || frame_.isElsewhere(box.x + i, v)) {
        miss[i] = {};
        continue;
      }
      cv::Vec3f expected = drawn[i];
      if (passing[i] != cv::Vec3f()) expected += passing[i].mul(revealedAt(box.x + i, v).colour);
      miss[i] = {linearFromCode(codes[i][0]) - expected[0],
                 linearFromCode(codes[i][1]) - expected[1],
                 linearFromCode(codes[i][2]) - expected[2], 1.0f};
    }
  }
}

// Pixels that no surface at rest is drawn in, but to which its rim may have come, each with the
// nearest drawn one: carried from neighbour to neighbour, down and up again (Danielsson 1980).
void FrameCompositor::findRims(const cv::Rect& carried) {
  const cv::Rect box = carried - region_.tl();
  const auto isDrawnAtRest = [&](std::uint32_t id) {
    return id != VisibilityBuffer::kNothing && frame_.objectOf(id).isAtRestInVideo();
  };
  cv::Mat index(region_.size(), CV_32S, cv::Scalar(-1));
  for (int v = 0; v < region_.height; ++v) {
    rim_rows_.push_back(rims_.size());
    const std::uint32_t* ids = centre_->ids(v);
    const std::uint8_t* reach = rest_.reach.ptr<std::uint8_t>(v + region_.y) + region_.x;
    for (int u = box.x; v >= box.y && v < box.br().y && u < box.br().x; ++u) {
      if (reach[u] == 0 || isDrawnAtRest(ids[u])) continue;
      index.at<int>(v, u) = static_cast<int>(rims_.size());
      rims_.push_back({u, v, {-1, -1}});
    }
  }
  rim_rows_.push_back(rims_.size());
  const auto look = [&](Rim& rim, int du, int dv) {
    const cv::Point q(rim.u + du, rim.v + dv);
    if (q.x < 0 || q.y < 0 || q.x >= region_.width || q.y >= region_.height) return;
    const int other = index.at<int>(q);
    const cv::Point drawn = other >= 0                              ? rims_[other].nearest
                            : isDrawnAtRest(centre_->ids(q.y)[q.x]) ? q
                                                                    : cv::Point(-1, -1);
    if (drawn.x < 0) return;
    const auto squared = [&](const cv::Point& p) {
      return (p.x - rim.u) * (p.x - rim.u) + (p.y - rim.v) * (p.y - rim.v);
    };
    if (rim.nearest.x < 0 || squared(drawn) < squared(rim.nearest)) rim.nearest = drawn;
  };
  for (int pass = 0; pass < 2; ++pass) {
    for (std::size_t i = 0; i < rims_.size(); ++i)
      look(rims_[i], -1, 0), look(rims_[i], -1, -1), look(rims_[i], 0, -1), look(rims_[i], 1, -1);
    for (std::size_t i = rims_.size(); i-- > 0;)
      look(rims_[i], 1, 0), look(rims_[i], 1, 1), look(rims_[i], 0, 1), look(rims_[i], -1, 1);
  }
}

void FrameCompositor::addRimResidual(int v, Row& row) const {
  if (rims_.empty()) return;
  for (std::size_t i = rim_rows_[v - region_.y]; i < rim_rows_[v - region_.y + 1]; ++i) {
    const Rim& rim = rims_[i];
    if (rim.nearest.x < 0 || row.source[rim.u] == kOriginal) continue;
    const std::uint32_t id = centre_->ids(rim.nearest.y)[rim.nearest.x];
    const cv::Point from = rim.nearest + region_.tl();
    const Eigen::Vector2f moved =
        frame_.movement(id, static_cast<float>(from.x), static_cast<float>(from.y));
    // Where a surface that moves has turned away from, its rim has not come to.
    const cv::Point away = rim.nearest - cv::Point(rim.u, rim.v);
    const float reach = frame_.params.background.mask_margin_px + kNonePx;
    if (away.dot(away) > reach * reach && moved.norm() > kStillPx) continue;
    cv::Vec4f colour = row.at(rim.u);
    const cv::Vec3f plain(colour[0], colour[1], colour[2]);
    addResidual(rim.u + region_.x - moved.x(), v - moved.y(), moved, frame_.objectOf(id).surface,
                cv::Vec3f::all(1), colour);
    // Beside a surface of a new look the video has the old one's hue.
    const bool repainted =
        away.dot(away) <= kRepaintReach * kRepaintReach && frame_.objectOf(id).look.changes();
    const float brighter =
        luminance({colour[0], colour[1], colour[2]}) / std::max(luminance(plain), kDark);
    for (int c = 0; repainted && c < 3; ++c) colour[c] = plain[c] * brighter;
    row.set(rim.u, colour);
  }
}

// What drawing misses of the video at (u, v), on a pixel to which the surface there has moved.
// @param tint of the surface's new look, which what was missed takes on
void FrameCompositor::addResidual(float u, float v, const Eigen::Vector2f& moved, int owner,
                                  const cv::Vec3f& tint, cv::Vec4f& colour) const {
  const float squared = moved.squaredNorm();
  const bool sways = frame_.prepared.sways[owner];
  const float none = sways ? kNoneSwaying : kNonePx;
  if (squared >= none * none) return;
  const float part = 1.0f - smoothStep(sways ? kWholeSwaying : kWholePx, none, std::sqrt(squared));
  const cv::Vec4f miss = missAt(u, v, owner);
  const float moves = std::min(
      1.0f, squared / (kWholePx * kWholePx));  // unmoved, the video comes back whatever was drawn
  for (int c = 0; c < 3; ++c) {
    const float whole = colour[c] + part * tint[c] * miss[c];
    colour[c] =
        whole +
        moves * (std::clamp(whole, colour[c] / kMostChange, colour[c] * kMostChange) - whole);
  }
  colour[3] *= 1.0f - part * miss[3];
}

// @return 0 where nothing is known of this owner
cv::Vec4f FrameCompositor::missAt(float u, float v, int owner) const {
  const float fu = std::floor(u), fv = std::floor(v), x = u - fu, y = v - fv;
  const int i = static_cast<int>(fu) - miss_box_.x, j = static_cast<int>(fv) - miss_box_.y;
  cv::Vec4f sum;
  for (int k = 0; k < 4; ++k) {
    const float weight = ((k & 1) != 0 ? x : 1.0f - x) * ((k & 2) != 0 ? y : 1.0f - y);
    const int column = i + (k & 1), row = j + (k >> 1);
    if (weight == 0.0f || column < 0 || row < 0 || column >= miss_.cols || row >= miss_.rows)
      continue;
    if (rest_.owners.at<short>(row + miss_box_.y, column + miss_box_.x) == owner)
      sum += weight * miss_.at<cv::Vec4f>(row, column);
  }
  return sum;
}

}  // namespace calipso::render
