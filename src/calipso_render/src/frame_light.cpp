// The part of FrameCompositor that measures the light of a frame: sun and sky on the support
// planes, before and after the edit, and the sun on the drawn surfaces.

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "calipso_render/colour.hpp"
#include "calipso_render/ray_shadow.hpp"
#include "calipso_render/shadow_map.hpp"
#include "frame_compositor.hpp"
#include "marked.hpp"
#include "plane_light.hpp"
#include "view_warp.hpp"

namespace calipso::render {
namespace {

constexpr int kShadowMapSide = 512;  // texels, live
constexpr int kSkyMapSide = 128;     // the same for the sky, which is soft
constexpr int kSkySteps = 160;       // places along the picture's width where the sky is measured
// of the light: between corners that differ by no more it is interpolated
constexpr float kEvenLight = 0.06f;
constexpr float kSmoothLight = 0.015f;  // likewise where the light in their middle is their mean
                                        // but for this; half of it over two steps
constexpr int kShadowBoundsMargin = 8;  // px
constexpr float kReliefMargin = 0.01f;  // m: planes have boxes without thickness
// of the height: a vertex that far below its plane still shades it
constexpr float kHeightTolerance = 0.02f;

int skyStep(const cv::Size& picture) { return std::max(4, picture.width / kSkySteps); }

// The sky over a support plane as one wide light: near contact an object hides much of it.
std::unique_ptr<Visibility> skyShadowOf(const std::vector<Occluder>& all,
                                        const RenderParams& params) {
  const std::vector<Occluder> occluders = params.planes.empty() ? std::vector<Occluder>{} : all;
  const Eigen::Vector3d up = params.planes.empty() ? params.up : params.planes.front().normal;
  if (params.quality == Quality::kFinal)
    return std::make_unique<RayShadow>(occluders, up, RayShadow::Params{kSkyRadius, 48});
  return std::make_unique<ShadowMap>(occluders, up, ShadowMap::Params{kSkyMapSide, kSkyRadius, 24});
}

std::unique_ptr<Visibility> shadowOf(const std::vector<Occluder>& occluders, const Light& light,
                                     const RenderParams& params) {
  const Eigen::Vector3d direction = light.direction.cast<double>();
  if (params.quality == Quality::kFinal)
    return std::make_unique<RayShadow>(occluders, direction,
                                       RayShadow::Params{params.sun_radius, 24});
  return std::make_unique<ShadowMap>(occluders, direction,
                                     ShadowMap::Params{kShadowMapSide, params.sun_radius, 16});
}

std::uint8_t levelAt(const cv::Mat& picture, int u, int v) {
  return picture.empty() ? 255 : picture.at<std::uint8_t>(v, u);
}

// Product of two levels, 255 = 1.
std::uint8_t both(std::uint8_t a, std::uint8_t b) {
  const unsigned product = a * static_cast<unsigned>(b) + 128;
  return static_cast<std::uint8_t>((product + (product >> 8)) >> 8);
}

}  // namespace

void FrameCompositor::prepareShadows() {
  std::vector<Occluder> moved, others, originals;
  for (std::size_t slot = 0; slot < actors_.size(); ++slot) {
    auto& list = edited_[surface_of_slot_[slot]] ? moved : others;
    list.push_back({&actors_[slot].vertices, &actors_[slot].surface->triangles,
                    actors_[slot].surface->winding});
  }
  for (std::size_t i = 0; i < edited_.size(); ++i) {
    const Surface& s = prepared_.surfaces[i];
    if (edited_[i] && !prepared_.moves[i] && s.in_video)
      originals.push_back({&s.key_vertices, &s.triangles, s.winding});
  }
  moved_shadow_ = shadowOf(moved, light_, params_);
  moved_sky_ = skyShadowOf(moved, params_);
  for (const Occluder& o : moved) moved_bounds_ |= shadowBounds(*o.vertices, light_);
  const bool same = shadows_.others && shadows_.edited == edited_ &&
                    shadows_.sun == light_.direction && sameView(shadows_.camera, frame_.camera);
  const bool others_rest =
      std::find(prepared_.moves.begin(), prepared_.moves.end(), true) == prepared_.moves.end();
  if (!same || !others_rest) cacheOthers(others);
  if (!same) cacheOriginals(originals);
  shadows_.edited = edited_, shadows_.camera = frame_.camera, shadows_.sun = light_.direction;
}

void FrameCompositor::cacheOthers(const std::vector<Occluder>& others) {
  shadows_.others = shadowOf(others, light_, params_);
  cv::Rect bounds;
  for (const Occluder& o : others) bounds |= shadowBounds(*o.vertices, light_);
  shadows_.others_sun = bounds.empty() ? cv::Mat() : sunOver(*shadows_.others, bounds);
  shadows_.others_sky = others.empty() ? cv::Mat()
                                       : skyOver(*skyShadowOf(others, params_),
                                                 {{0, 0}, frame_.bgr.size()}, SquareMask());
}

void FrameCompositor::cacheOriginals(const std::vector<Occluder>& originals) {
  const cv::Rect whole({0, 0}, frame_.bgr.size());
  shadows_.bounds = {};
  for (const Occluder& o : originals)
    shadows_.bounds |= shadowBounds(*o.vertices, prepared_.light.light);
  shadows_.originals =
      originals.empty() ? nullptr : shadowOf(originals, prepared_.light.light, params_);
  shadows_.originals_sun =
      shadows_.bounds.empty() ? cv::Mat() : sunOver(*shadows_.originals, shadows_.bounds);
  shadows_.originals_sky = originals.empty()
                               ? cv::Mat(whole.size(), CV_8U, cv::Scalar(255))
                               : skyOver(*skyShadowOf(originals, params_), whole, SquareMask());
  leaveHidden(shadows_.originals_sky, whole);
  shadows_.shaded = cv::Mat::zeros(whole.size(), CV_8U);
#pragma omp parallel for schedule(static)
  for (int v = 0; v < whole.height; ++v) {
    for (int u = 0; u < whole.width; ++u) {
      const std::uint8_t sun = levelAt(shadows_.originals_sun, u, v),
                         sky = shadows_.originals_sky.at<std::uint8_t>(v, u);
      if ((sun == 255 && sky == 255) || !takesShadow(u, v)) continue;
      shadows_.shaded.at<std::uint8_t>(v, u) = changeOfLight(darkeningAt(u, v, sun, sky));
    }
  }
  cv::dilate(shadows_.shaded, shadows_.shaded, disc(params_.background.shadow_margin_px));
  shadows_.shaded_box = cv::boundingRect(shadows_.shaded);
}

// Part of its brightness that a pixel loses which gets these levels of sun and sky.
float FrameCompositor::darkeningAt(int u, int v, std::uint8_t sun, std::uint8_t sky) const {
  if (place_view_.relief().at(u, v))
    return (1.0f - place_view_.relief().umbra.at<float>(v, u)) * (1.0f - kPerLevel * sun);
  return 1.0f - luminance(shadowRatio(kPerLevel * sun, kPerLevel * sky));
}

// Edited objects hide only that part of the sky which others leave: the picture's pixels lack
// theirs already.
// @param sky of edited objects alone, over `region`
void FrameCompositor::leaveHidden(cv::Mat& sky, const cv::Rect& region) const {
  if (shadows_.others_sky.empty()) return;
  const float all_hidden = skyLight(0.0f), scale = kPerLevel / (1.0f - all_hidden),
              offset = all_hidden / (1.0f - all_hidden);
#pragma omp parallel for schedule(static)
  for (int v = 0; v < region.height; ++v) {
    const std::uint8_t* others = shadows_.others_sky.ptr<std::uint8_t>(v + region.y) + region.x;
    std::uint8_t* row = sky.ptr<std::uint8_t>(v);
    for (int u = 0; u < region.width; ++u) {
      const float left = std::clamp(scale * others[u] - offset, 0.0f, 1.0f);
      row[u] = static_cast<std::uint8_t>(255.5f - left * static_cast<float>(255 - row[u]));
    }
  }
}

cv::Mat FrameCompositor::sunOver(const Visibility& shadow, const cv::Rect& bounds) const {
  cv::Mat sun(frame_.bgr.size(), CV_8U, cv::Scalar(255)), part = sun(bounds);
  planesInLight(place_view_, shadow, bounds, SquareMask(), part);
  return sun;
}

// The sky changes slowly over a support plane: measured on a grid that hangs on the picture,
// interpolated between.
// @param skip where it is not wanted
cv::Mat FrameCompositor::skyOver(const Visibility& shadow, const cv::Rect& region,
                                 const SquareMask& skip) const {
  const int step = skyStep(frame_.bgr.size());
  const cv::Point first(region.x / step, region.y / step);
  cv::Mat grid((region.br().y - 1) / step - first.y + 2, (region.br().x - 1) / step - first.x + 2,
               CV_32F, cv::Scalar(1.0f));
#pragma omp parallel for schedule(dynamic, 4)
  for (int j = 0; j < grid.rows; ++j) {
    Receiver r;
    for (int i = 0; i < grid.cols; ++i) {
      const int u = (first.x + i) * step, v = (first.y + j) * step;
      if (!skip.at(u, v) && place_view_.planes().at(u, v, r))
        grid.at<float>(j, i) = skyLight(shadow.visibility(r.position, r.normal));
    }
  }
  cv::Mat sky(region.size(), CV_8U);
#pragma omp parallel
  {
    std::vector<float> line(grid.cols);
    std::vector<std::uint8_t> whole(static_cast<std::size_t>(grid.cols) * step);
#pragma omp for schedule(static)
    for (int v = 0; v < region.height; ++v) {
      const int j = (region.y + v) / step - first.y;
      const float y = static_cast<float>((region.y + v) % step) / step;
      const float *above = grid.ptr<float>(j), *below = grid.ptr<float>(j + 1);
      for (int i = 0; i < grid.cols; ++i) line[i] = (1.0f - y) * above[i] + y * below[i];
      for (int i = 0; i + 1 < grid.cols; ++i) {
        const float left = line[i], rise = (line[i + 1] - left) / step;
        if (rise == 0.0f)
          std::fill_n(&whole[i * step], step, lightLevel(left));
        else
          for (int k = 0; k < step; ++k)
            whole[i * step + k] = lightLevel(left + rise * static_cast<float>(k));
      }
      std::copy_n(whole.begin() + region.x % step, region.width, sky.ptr<std::uint8_t>(v));
    }
  }
  return sky;
}

// Where the sun's rays through the vertices pass through the box that the relief is in.
void FrameCompositor::addReliefBounds(const Points& vertices, const Eigen::Vector3f& sun,
                                      Points& shadow) const {
  const Relief& relief = place_view_.relief();
  if (relief.empty() || relief.box.isEmpty()) return;
  const Eigen::Array3f low = relief.box.min().array() - kReliefMargin,
                       high = relief.box.max().array() + kReliefMargin;
  const Eigen::Array3f way = -sun.array();
  for (const Eigen::Vector3f& p : vertices) {
    float enter = 0.0f, leave = 1e9f;
    for (int k = 0; k < 3; ++k) {
      const float slope = std::abs(way[k]) > 1e-6f ? way[k] : 1e-6f, a = (low[k] - p[k]) / slope,
                  b = (high[k] - p[k]) / slope;
      enter = std::max(enter, std::min(a, b)), leave = std::min(leave, std::max(a, b));
    }
    if (enter >= leave) continue;
    const float spread = static_cast<float>(params_.sun_radius) * leave;
    const Eigen::Vector3f side = sun.unitOrthogonal(), other = sun.cross(side),
                          far = p - leave * sun;
    shadow.insert(shadow.end(), {p - enter * sun, far + spread * side, far - spread * side,
                                 far + spread * other, far - spread * other});
  }
}

// Pixels onto which the sun can cast the vertices' shadow.
cv::Rect FrameCompositor::shadowBounds(const Points& vertices, const Light& light) const {
  const Eigen::Vector3f l = light.direction;
  Points shadow;
  for (const SupportPlane& plane : params_.planes) {
    const Eigen::Vector3f n = plane.normal.cast<float>();
    const float slope = n.dot(l);
    if (slope < 0.02f) continue;
    const Eigen::Vector3f side = n.unitOrthogonal(), other = n.cross(side);
    for (const Eigen::Vector3f& p : vertices) {
      const float height = n.dot(p) - static_cast<float>(plane.offset);
      if (height < -kHeightTolerance) continue;
      const float spread = params_.sun_radius * height / (slope * slope);
      const Eigen::Vector3f foot = p - l * (height / slope);
      shadow.insert(shadow.end(), {foot + spread * side, foot - spread * side,
                                   foot + spread * other, foot - spread * other});
    }
  }
  addReliefBounds(vertices, l, shadow);
  return boundsOf(projectMesh(shadow, {}, frame_.camera), kShadowBoundsMargin, frame_.bgr.size());
}

void FrameCompositor::findCovered() {
  drawn_.create(region_.size(), CV_8U);
  all_drawn_ =
      std::all_of(always_drawn_.begin(), always_drawn_.end(), [](bool always) { return always; });
#pragma omp parallel for schedule(static)
  for (int v = 0; v < region_.height; ++v) {
    const std::uint32_t* ids = centre_->ids(v);
    std::uint8_t* drawn = drawn_.ptr<std::uint8_t>(v);
    if (all_drawn_) {
      for (int u = 0; u < region_.width; ++u)
        drawn[u] = ids[u] != VisibilityBuffer::kNothing ? 255 : 0;
    } else {
      for (int u = 0; u < region_.width; ++u)
        drawn[u] = isDrawn(ids[u], u + region_.x, v + region_.y) ? 255 : 0;
    }
  }
  covered_ = SquareMask(drawn_, region_, params_.background.shadow_margin_px + 2);
}

void FrameCompositor::measureSky() {
  sky_now_ = skyOver(*moved_sky_, region_, covered_);
  leaveHidden(sky_now_, region_);
  sky_before_ = shadows_.originals_sky(region_);
}

void FrameCompositor::measureSun() {
  sun_now_ = cv::Mat(region_.size(), CV_8U, cv::Scalar(255));
  sun_before_.create(region_.size(), CV_8U);
  takes_light_.create(region_.size(), CV_8U);
  const cv::Rect bounds = moved_bounds_ & region_;
  if (!bounds.empty()) {
    cv::Mat part = sun_now_(bounds - region_.tl());
    planesInLight(place_view_, *moved_shadow_, bounds, covered_, part);
  }
#pragma omp parallel for schedule(static)
  for (int v = 0; v < region_.height; ++v) joinSun(v);
  takeReliefInPlaneTerms();
}

// The sun alone shades the relief; what its levels do to the support planes they do not do to it.
void FrameCompositor::takeReliefInPlaneTerms() {
  const Relief& relief = place_view_.relief();
  if (relief.empty()) return;
  sky_before_ = sky_before_.clone();  // it is the cache's
  const float planes_umbra = luminance(prepared_.umbra);
#pragma omp parallel for schedule(static)
  for (int v = 0; v < region_.height; ++v) {
    std::uint8_t *sun_now = sun_now_.ptr<std::uint8_t>(v), *sky_now = sky_now_.ptr<std::uint8_t>(v);
    std::uint8_t *sun_before = sun_before_.ptr<std::uint8_t>(v),
                 *sky_before = sky_before_.ptr<std::uint8_t>(v);
    const float* umbra = relief.umbra.ptr<float>(v + region_.y) + region_.x;
    const std::uint8_t* seen = relief.seen.ptr<std::uint8_t>(v + region_.y) + region_.x;
    const auto take = [&](int u, std::uint8_t& sun, std::uint8_t& sky) {
      const PlaneTerms terms = inPlaneTerms(kPerLevel * sun, umbra[u], planes_umbra);
      sun = lightLevel(terms.sun), sky = lightLevel(terms.sky);
    };
    for (int u = nextMarked(seen, 0, region_.width); u < region_.width;
         u = nextMarked(seen, u + 1, region_.width)) {
      take(u, sun_now[u], sky_now[u]), take(u, sun_before[u], sky_before[u]);
    }
  }
}

// Row v of what edited objects and others shade together, and of what was shaded before.
void FrameCompositor::joinSun(int v) {
  std::uint8_t *now = sun_now_.ptr<std::uint8_t>(v), *before = sun_before_.ptr<std::uint8_t>(v),
               *takes = takes_light_.ptr<std::uint8_t>(v);
  const auto rowOf = [&](const cv::Mat& picture) {
    return picture.empty() ? nullptr : picture.ptr<std::uint8_t>(v + region_.y) + region_.x;
  };
  const std::uint8_t *others = rowOf(shadows_.others_sun),
                     *originals = rowOf(shadows_.originals_sun), *none = rowOf(shadowless_);
  const int width = region_.width;
  if (originals != nullptr)
    std::copy_n(originals, width, before);
  else
    std::fill_n(before, width, 255);
  for (int u = 0; others != nullptr && u < width; ++u)
    now[u] = both(now[u], others[u]), before[u] = both(before[u], others[u]);
  place_view_.seesRow(region_.x, v + region_.y, width, takes);
  for (int u = 0; none != nullptr && u < width; ++u) takes[u] = none[u] == 0 ? takes[u] : 0;
  for (int u = 0; u < width;) {
    const int end = std::min(width, u + SquareMask::kSide - (region_.x + u) % SquareMask::kSide);
    if (covered_.at(region_.x + u, region_.y + v)) std::fill(takes + u, takes + end, 0);
    u = end;
  }
}

const Look& FrameCompositor::lookOf(int slot) const {
  static const Look as_it_is;
  const ObjectInFrame* state = states_[surface_of_slot_[slot]];
  return state != nullptr ? state->look : as_it_is;
}

FrameCompositor::Lit FrameCompositor::exactLight(const LitPoint& p, int slot) const {
  const float sun = p.normal.dot(light_.direction) > 0.0f ? newSun(p.position, p.normal) : 0.0f;
  const PointLight::Shading shading =
      point_light_.at(glosses_[slot], prepared_.appearances[surface_of_slot_[slot]].tint, p.normal,
                      (eye_ - p.position).normalized(), sun, p.sky);
  return {shading.diffuse, shading.highlight, slot};
}

// Light at the corners of small squares; where a smooth piece of surface fills a square and the
// light changes little over it, the points between take it from the corners. Squares of twice the
// side are tried first.
void FrameCompositor::findSurfaceLight() {
  const int columns = (region_.width / kLightStep + 3) | 1,
            rows = (region_.height / kLightStep + 3) | 1;
  lit_.assign(static_cast<std::size_t>(columns) * rows, {});
  smooth_.assign(lit_.size(), 0);
  lit_columns_ = columns, lit_rows_ = rows;
  const int across = columns / 2;
  std::vector<std::uint8_t> smooth(static_cast<std::size_t>(across) *
                                   (rows / 2));  // per large square
#pragma omp parallel
  {
// Corners and middles of large squares.
#pragma omp for schedule(dynamic, 4)
    for (int j = 0; j < rows; ++j) {
      for (int i = j % 2; i < columns; i += 2) lightCorner(i, j);
    }
#pragma omp for schedule(dynamic, 4)
    for (int j = 0; j < rows / 2; ++j) {
      for (int i = 0; i < across; ++i)
        smooth[static_cast<std::size_t>(j) * across + i] = isSmooth(2 * i, 2 * j, 2) ? 1 : 0;
    }
    const auto isLarge = [&](int i, int j) {
      return i < 0 || j < 0 || i >= across || j >= rows / 2 ||
             smooth[static_cast<std::size_t>(j) * across + i] != 0;
    };
    // The places on their sides.
#pragma omp for schedule(dynamic, 4)
    for (int j = 0; j < rows; ++j) {
      for (int i = 1 - j % 2; i < columns; i += 2) {
        const bool follows = isLarge(i / 2, j / 2) &&
                             (j % 2 == 0 ? isLarge(i / 2, j / 2 - 1) : isLarge(i / 2 - 1, j / 2));
        if (follows)
          interpolateCorner(i, j);
        else
          lightCorner(i, j);
      }
    }
#pragma omp for schedule(dynamic, 4)
    for (int j = 0; j < rows - 1; ++j) {
      for (int i = 0; i + 1 < columns; ++i)
        smooth_[static_cast<std::size_t>(j) * columns + i] =
            smooth[static_cast<std::size_t>(j / 2) * across + i / 2] != 0 || isSmooth(i, j, 1) ? 1
                                                                                               : 0;
    }
  }
}

void FrameCompositor::lightCorner(int i, int j) {
  lit_[static_cast<std::size_t>(j) * lit_columns_ + i] =
      lightAt(region_.x + i * kLightStep, region_.y + j * kLightStep);
}

FrameCompositor::Lit FrameCompositor::lightAt(int u, int v) const {
  const std::uint32_t id = centre_->idAt(u, v);
  if (!region_.contains({u, v}) || !isDrawn(id, u, v)) return {};
  const int slot = VisibilityBuffer::objectOf(id);
  Lit lit = exactLight(litPoint(actors_[slot], VisibilityBuffer::triangleOf(id),
                                static_cast<float>(u), static_cast<float>(v), eye_),
                       slot);
  lit.diffuse[3] = centre_->nearnessAt(u, v);
  return lit;
}

// On a side of large squares that are smooth.
void FrameCompositor::interpolateCorner(int i, int j) {
  Lit* lit = &lit_[static_cast<std::size_t>(j) * lit_columns_ + i];
  const std::ptrdiff_t to_end = i % 2 == 1 ? 1 : lit_columns_;
  const Lit &a = lit[-to_end], &b = lit[to_end];
  *lit = {0.5f * (a.diffuse + b.diffuse), 0.5f * (a.highlight + b.highlight), a.slot};
}

// Does the light in a square of `size` steps follow from that at its corners? Where they differ,
// its middle has to agree.
bool FrameCompositor::isSmooth(int i, int j, int size) const {
  const Lit* first = &lit_[static_cast<std::size_t>(j) * lit_columns_ + i];
  const std::size_t down = static_cast<std::size_t>(size) * lit_columns_;
  const Lit &a = first[0], &b = first[size], &c = first[down], &d = first[down + size];
  if (a.slot < 0 || a.slot != b.slot || a.slot != c.slot || a.slot != d.slot) return false;
  if (std::abs(a.diffuse[3] + d.diffuse[3] - b.diffuse[3] - c.diffuse[3]) * frame_.camera.fx >
      kLightStep * a.diffuse[3])
    return false;
  cv::Vec4f mean;
  bool even = size == 1;
  float highest[3];
  for (int k = 0; k < 3; ++k) {
    const float all[] = {a.diffuse[k] + a.highlight[k], b.diffuse[k] + b.highlight[k],
                         c.diffuse[k] + c.highlight[k], d.diffuse[k] + d.highlight[k]};
    const auto [low, high] = std::minmax_element(std::begin(all), std::end(all));
    mean[k] = 0.25f * (all[0] + all[1] + all[2] + all[3]), highest[k] = *high;
    even = even && *high - *low <= kEvenLight * *high;
  }
  if (even) return true;
  const Lit middle = size == 2 ? first[lit_columns_ + 1]
                               : lightAt(region_.x + i * kLightStep + kLightStep / 2,
                                         region_.y + j * kLightStep + kLightStep / 2);
  if (middle.slot != a.slot) return false;
  for (int k = 0; k < 3; ++k) {
    if (std::abs(middle.diffuse[k] + middle.highlight[k] - mean[k]) >
        kSmoothLight / static_cast<float>(size) * highest[k])
      return false;
  }
  return true;
}

}  // namespace calipso::render
