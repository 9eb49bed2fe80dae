#include "plane_mirror.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/core/hal/intrin.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "calipso_render/colour.hpp"
#include "calipso_render/inpaint.hpp"
#include "plane_view.hpp"

namespace calipso::render {
namespace {

constexpr float kAtNormal = 0.03f;  // reflectance at normal incidence: between water and varnish
constexpr int kTestedWidth = 192;   // px to which the picture is brought down for the test
constexpr double kAround = 10.0;    // px of those: deviation of the weights around a pixel
constexpr int kSquare = 8;          // px of the squares of which every other one is held out
constexpr int kFarthest = 64;       // px by which the image is displaced for comparison
// correlation with the image in place up to which a displaced one is another
constexpr double kAlike = 0.3;
constexpr int kFewestOthers = 12;    // such displaced images, at least
constexpr double kClear = 1.8;       // times what the best of them explains
constexpr double kExplained = 0.04;  // of the squares around the image, at least
// strengths, times what water and varnish mirror: dull ones, and polished steel
constexpr double kFaintest = 0.3, kBrightest = 10.0;
constexpr int kMisplaced = 2;  // px by which the image may be displaced against its place
constexpr float kSlopes[] = {0.0f, 0.01f, 0.02f, 0.04f, 0.08f, 0.16f};  // that are tried
constexpr int kBlurs = 7;           // levels of blur, each twice the one before,
constexpr float kLeastBlur = 0.5f;  // px, from this one on
constexpr int kSpreadStep = 4;      // px between the places where the spread is found
constexpr double kUsual = 1e-3;     // weight of the usual strength, to that of what is seen
constexpr double kRidge = 1e-6;

// The mirror image of a surface in a plane as the camera sees it; what lies below the plane is not
// mirrored.
ScreenMesh mirrored(const Actor& actor, const SupportPlane& plane, const Camera& camera) {
  const Eigen::Vector3f n = plane.normal.cast<float>();
  Points points = actor.vertices;
  for (Eigen::Vector3f& p : points)
    p -= (std::max(0.0f, n.dot(p) - static_cast<float>(plane.offset)) + n.dot(p) -
          static_cast<float>(plane.offset)) *
         n;
  ScreenMesh mesh = projectMesh(points, actor.surface->triangles, camera);
  const bool around_us = std::any_of(mesh.points.begin(), mesh.points.end(),
                                     [](const Eigen::Vector3f& p) { return std::isnan(p.z()); });
  mesh.hidden_side = around_us ? 0 : -actor.surface->winding;
  return mesh;
}

float schlick(float cosine) {
  const float rest = 1.0f - std::clamp(cosine, 0.0f, 1.0f), squared = rest * rest;
  return kAtNormal + (1.0f - kAtNormal) * squared * squared * rest;
}

void addPlane(const std::vector<const Actor*>& actors, const Radiance& radiance,
              const PlaneView& view, const SupportPlane& plane, const Camera& camera,
              const cv::Mat& off, MirrorImage& image, cv::Mat& near) {
  std::vector<ScreenMesh> meshes;
  cv::Rect box;
  for (const Actor* a : actors) {
    meshes.push_back(mirrored(*a, plane, camera));
    box |= boundsOf(meshes.back(), 1, {camera.width, camera.height});
  }
  if (box.empty()) return;
  VisibilityBuffer buffer(box);
  for (std::size_t slot = 0; slot < meshes.size(); ++slot)
    buffer.draw(meshes[slot], static_cast<int>(slot));
  const Eigen::Vector3f n = plane.normal.cast<float>(),
                        eye = camera.world_from_camera.translation().cast<float>();
  const Eigen::Vector3f mirrored_eye =
      eye - 2.0f * (n.dot(eye) - static_cast<float>(plane.offset)) * n;
  if (image.empty())
    image = {cv::Mat::zeros(camera.height, camera.width, CV_32FC3),
             cv::Mat::zeros(camera.height, camera.width, CV_32F),
             {},
             1.0f};
#pragma omp parallel for schedule(dynamic, 4)
  for (int v = box.y; v < box.br().y; ++v) {
    for (int u = box.x; u < box.br().x; ++u) {
      const std::uint32_t id = buffer.idAt(u, v);
      if (id == VisibilityBuffer::kNothing || (!off.empty() && off.at<std::uint8_t>(v, u) != 0))
        continue;
      Receiver receiver;
      if (!view.at(static_cast<float>(u), static_cast<float>(v), receiver) ||
          receiver.normal.dot(n) < 0.999f)
        continue;
      const float above = n.dot(receiver.position) - static_cast<float>(plane.offset);
      if (std::abs(above) > 1e-3f * (eye - receiver.position).norm()) continue;  // another plane
      const int slot = VisibilityBuffer::objectOf(id), triangle = VisibilityBuffer::triangleOf(id);
      const Eigen::Vector3f weights =
          barycentric(meshes[slot], triangle, static_cast<float>(u), static_cast<float>(v));
      const float part = schlick(n.dot((eye - receiver.position).normalized()));
      image.cover.at<float>(v, u) = part;
      near.at<float>(v, u) = buffer.nearnessAt(u, v);
      image.colour.at<cv::Vec3f>(v, u) =
          part * radiance(slot, surfacePoint(*actors[slot], triangle, weights, mirrored_eye));
    }
  }
}

// Means of what is known in squares of kSpreadStep px, for pushPull(), and how far they are known.
void bringDown(const cv::Mat& near, cv::Mat& mean, cv::Mat& weight) {
  const cv::Size size((near.cols + kSpreadStep - 1) / kSpreadStep,
                      (near.rows + kSpreadStep - 1) / kSpreadStep);
  mean = cv::Mat::zeros(size, CV_32FC3), weight = cv::Mat::zeros(size, CV_32F);
#pragma omp parallel for schedule(static)
  for (int j = 0; j < size.height; ++j) {
    for (int i = 0; i < size.width; ++i) {
      float sum = 0.0f;
      int count = 0;
      for (int v = j * kSpreadStep; v < std::min(near.rows, (j + 1) * kSpreadStep); ++v) {
        for (int u = i * kSpreadStep; u < std::min(near.cols, (i + 1) * kSpreadStep); ++u) {
          sum += near.at<float>(v, u), count += near.at<float>(v, u) > 0.0f;
        }
      }
      if (count > 0)
        mean.at<cv::Vec3f>(j, i) = cv::Vec3f::all(sum / static_cast<float>(count)),
                              weight.at<float>(j, i) = 1.0f;
    }
  }
}

// A facet that is tilted by s turns the mirrored ray by 2 s: behind it, over the way D2 to the
// object, by 2 s D2 px f / (D1 + D2); along a row it is less by the cosine of incidence. The
// objects' distance is taken on smoothly beyond them. All of it changes slowly over the picture.
void findSpread(const PlaneView& view, const Camera& camera, const cv::Mat& near,
                MirrorImage& image) {
  cv::Mat mean, weight;
  bringDown(near, mean, weight);
  const cv::Mat filled = pushPull(mean, weight);
  cv::Mat spread = cv::Mat::zeros(weight.size(), CV_32F), whole;
  const Eigen::Isometry3f from_world = camera.world_from_camera.inverse().cast<float>();
  const Eigen::Vector3f eye = camera.world_from_camera.translation().cast<float>();
  double cosines = 0.0;
  int count = 0;
  for (int j = 0; j < spread.rows; ++j) {
    for (int i = 0; i < spread.cols; ++i) {
      constexpr float kMiddle = 0.5f * (kSpreadStep - 1);
      Receiver receiver;
      if (!view.at(static_cast<float>(i * kSpreadStep) + kMiddle,
                   static_cast<float>(j * kSpreadStep) + kMiddle, receiver))
        continue;
      const float depth = (from_world * receiver.position).z(),
                  behind = 1.0f - depth * filled.at<cv::Vec3f>(j, i)[0];
      spread.at<float>(j, i) = 2.0f * static_cast<float>(camera.fy) * std::max(0.0f, behind);
      if (weight.at<float>(j, i) > 0.0f)
        cosines += receiver.normal.dot((eye - receiver.position).normalized()), ++count;
    }
  }
  cv::resize(spread, whole, spread.size() * kSpreadStep, 0, 0, cv::INTER_LINEAR);
  image.spread = whole(cv::Rect({0, 0}, near.size())).clone();
  if (count > 0) image.across = static_cast<float>(cosines / count);
}

// A level of blur: wide ones of a smaller picture, whose pixels are half as wide as the blur at
// most.
struct Blurred {
  cv::Mat picture;      // CV_32FC4
  float columns, rows;  // of it, per pixel
  int first;            // row that it begins with, where it is as large

  cv::v_float32x4 at(int u, int v) const {
    if (columns == 1.0f && rows == 1.0f) return cv::v_load(picture.at<cv::Vec4f>(v - first, u).val);
    const float x = std::clamp((static_cast<float>(u) + 0.5f) * columns - 0.5f, 0.0f,
                               static_cast<float>(picture.cols - 1));
    const float y = std::clamp((static_cast<float>(v) + 0.5f) * rows - 0.5f, 0.0f,
                               static_cast<float>(picture.rows - 1));
    const int i = static_cast<int>(x), j = static_cast<int>(y),
              right = std::min(i + 1, picture.cols - 1);
    const cv::Vec4f *above = picture.ptr<cv::Vec4f>(j),
                    *below = picture.ptr<cv::Vec4f>(std::min(j + 1, picture.rows - 1));
    const auto mix = [](const cv::v_float32x4& a, const cv::v_float32x4& b, float part) {
      return a + cv::v_setall_f32(part) * (b - a);
    };
    const auto along = [&](const cv::Vec4f* row) {
      return mix(cv::v_load(row[i].val), cv::v_load(row[right].val), x - static_cast<float>(i));
    };
    return mix(along(above), along(below), y - static_cast<float>(j));
  }
};

// Values drawn out by `slope`: between levels of blur.
class DrawnOut {
 public:
  DrawnOut(const cv::Mat& spread, float across, float slope)
      : across_(across),
        level_(spread.size(), CV_32F),
        lowest_(spread.rows),
        highest_(spread.rows) {
#pragma omp parallel for schedule(static)
    for (int v = 0; v < spread.rows; ++v) {
      float* levels = level_.ptr<float>(v);
      for (int u = 0; u < spread.cols; ++u) {
        const float px = slope * spread.at<float>(v, u);
        levels[u] =
            std::clamp(std::log2(std::max(px, kLeastBlur) / kLeastBlur), 0.0f, kBlurs - 1.001f);
      }
      const auto [low, high] = std::minmax_element(levels, levels + spread.cols);
      lowest_[v] = static_cast<int>(*low), highest_[v] = static_cast<int>(*high);
    }
  }

  // @param values CV_32FC4: colour and cover
  cv::Mat operator()(const cv::Mat& values) const {
    std::vector<Blurred> levels;
    for (int k = 0; k <= *std::max_element(highest_.begin(), highest_.end()) + 1; ++k)
      levels.push_back(blurred(values, k));
    cv::Mat out(values.size(), CV_32FC4);
#pragma omp parallel for schedule(static)
    for (int v = 0; v < out.rows; ++v) {
      for (int u = 0; u < out.cols; ++u) {
        const float level = level_.at<float>(v, u);
        const int k = static_cast<int>(level);
        const cv::v_float32x4 lower = levels[k].at(u, v),
                              part = cv::v_setall_f32(level - static_cast<float>(k));
        cv::v_store(out.at<cv::Vec4f>(v, u).val, lower + part * (levels[k + 1].at(u, v) - lower));
      }
    }
    return out;
  }

 private:
  Blurred blurred(const cv::Mat& values, int level) const {
    const float along = kLeastBlur * static_cast<float>(1 << level),
                beside = std::max(kLeastBlur, across_ * along);
    const int rows = std::max(1, static_cast<int>(along / 2.0f)),
              columns = std::max(1, static_cast<int>(beside / 2.0f));
    Blurred out{{}, 1.0f, 1.0f, 0};
    cv::Mat from = values;
    if (rows > 1 || columns > 1) {
      cv::resize(values, from,
                 {(values.cols + columns - 1) / columns, (values.rows + rows - 1) / rows}, 0, 0,
                 cv::INTER_AREA);
      out.columns = static_cast<float>(from.cols) / values.cols,
      out.rows = static_cast<float>(from.rows) / values.rows;
    } else {
      const cv::Range used = rowsAt(level);
      if (used.empty()) return out;
      from = values.rowRange(used), out.first = used.start;
    }
    cv::GaussianBlur(from, out.picture, {}, beside / columns, along / rows, cv::BORDER_REPLICATE);
    return out;
  }

  // The rows that need a level of blur, and those between them.
  cv::Range rowsAt(int level) const {
    int first = 0, last = static_cast<int>(lowest_.size());
    const auto needs = [&](int v) { return lowest_[v] <= level && highest_[v] >= level - 1; };
    while (first < last && !needs(first)) ++first;
    while (last > first && !needs(last - 1)) --last;
    return {first, last};
  }

  float across_;
  cv::Mat level_;                      // CV_32F
  std::vector<int> lowest_, highest_;  // per row, whole levels
};

cv::Mat withCover(const MirrorImage& image) {
  cv::Mat out;
  cv::merge(std::vector<cv::Mat>{image.colour, image.cover}, out);
  return out;
}

// The test's pictures, brought down.
class Trial {
 public:
  Trial(const MirrorImage& image, const cv::Mat& picture, const cv::Mat& known)
      : scale_(std::max(1.0f, static_cast<float>(picture.cols) / kTestedWidth)) {
    const cv::Size size(cvRound(picture.cols / scale_), cvRound(picture.rows / scale_));
    const auto brought = [&](const cv::Mat& values) {
      cv::Mat out;
      cv::resize(values, out, size, 0, 0, cv::INTER_AREA);
      return out;
    };
    cv::Mat part;
    known.convertTo(part, CV_32F, 1.0 / 255.0);
    weight_ = cv::Mat::zeros(size, CV_32F);
    weight_.setTo(1.0f, brought(part) > 0.99f);
    cv::GaussianBlur(weight_, around_, {}, kAround);
    around_ = cv::max(around_, 1e-6);
    std::array<cv::Mat, 3> y;
    cv::split(brought(picture), y);
    for (int c = 0; c < 3; ++c) y_less_[c] = less(y[c]);
    image_ = brought(withCover(image));
    spread_ = brought(image.spread) / scale_, across_ = image.across;
  }

  struct Fit {
    double explained = 0.0;     // squares of what is held out
    std::array<double, 4> x{};  // strength; strength times the surroundings
    cv::Mat cover;              // cover'

    // What the objects' mirror image takes away was mirrored there.
    bool plausible() const { return std::min({x[1], x[2], x[3]}) >= 0.0; }
    double alike(const Fit& other) const {
      return cover.dot(other.cover) /
             std::sqrt(std::max(1e-30, cover.dot(cover) * other.cover.dot(other.cover)));
    }
  };

  // Drawn out by the planes' slope.
  cv::Mat drawnOut(float slope) const { return DrawnOut(spread_, across_, slope)(image_); }

  // @param drawn what drawnOut() gave; by px by which it is displaced
  Fit fit(const cv::Mat& drawn, int by) const {
    cv::Mat columns[4];
    cv::split(displaced(drawn, by), columns);
    for (cv::Mat& c : columns) c = less(c);
    std::array<Eigen::Matrix4d, 2> G{Eigen::Matrix4d::Zero(), Eigen::Matrix4d::Zero()};
    std::array<Eigen::Vector4d, 2> b{Eigen::Vector4d::Zero(), Eigen::Vector4d::Zero()};
    for (int v = 0; v < weight_.rows; ++v) {
      for (int u = 0; u < weight_.cols; ++u) {
        if (weight_.at<float>(v, u) == 0.0f) continue;
        const int half = (u / kSquare + v / kSquare) % 2;
        const double s = columns[3].at<float>(v, u);
        for (int c = 0; c < 3; ++c) {
          const double l = columns[c].at<float>(v, u), y = y_less_[c].at<float>(v, u);
          G[half](0, 0) += l * l, G[half](0, c + 1) -= l * s, G[half](c + 1, 0) -= l * s,
              G[half](c + 1, c + 1) += s * s;
          b[half][0] += l * y, b[half][c + 1] -= s * y;
        }
      }
    }
    Fit fit;
    for (int half = 0; half < 2; ++half) {
      const Eigen::Vector4d x = solve(G[1 - half], b[1 - half]);
      fit.explained += 2.0 * x.dot(b[half]) - x.dot(G[half] * x);
    }
    const Eigen::Vector4d x = solve(G[0] + G[1], b[0] + b[1]);
    std::copy_n(x.data(), 4, fit.x.begin());
    fit.cover = columns[3];
    return fit;
  }

  // What there is to explain around the image.
  double squares() const {
    cv::Mat cover, near;
    cv::extractChannel(image_, cover, 3);
    cv::dilate(cover > 0.0f, near, cv::Mat::ones(2 * kSquare + 1, 2 * kSquare + 1, CV_8U));
    double sum = 0.0;
    for (const cv::Mat& y : y_less_) {
      cv::Mat part = cv::Mat::zeros(y.size(), CV_32F);
      y.copyTo(part, near);
      sum += part.dot(part);
    }
    return sum;
  }

 private:
  // Of objects of one colour strength and surroundings are known together only: then the strength
  // is that of water and varnish, 1.
  static Eigen::Vector4d solve(const Eigen::Matrix4d& G, const Eigen::Vector4d& b) {
    const double weight = kUsual * G(0, 0);
    Eigen::Matrix4d A = G + 1e-12 * Eigen::Matrix4d::Identity();
    A(0, 0) += weight;
    for (int c = 1; c < 4; ++c) A(c, c) *= 1.0 + kRidge;
    Eigen::Vector4d x = A.ldlt().solve(b + weight * Eigen::Vector4d::UnitX());
    x[0] = std::clamp(x[0], kFaintest, kBrightest);
    for (int c = 1; c < 4; ++c) x[c] = (b[c] - A(c, 0) * x[0]) / A(c, c);
    return x;
  }

  static cv::Mat displaced(const cv::Mat& values, int by) {
    cv::Mat out = cv::Mat::zeros(values.size(), values.type());
    const int width = values.cols - std::abs(by);
    values(cv::Rect(std::max(0, -by), 0, width, values.rows))
        .copyTo(out(cv::Rect(std::max(0, by), 0, width, values.rows)));
    return out;
  }

  cv::Mat less(const cv::Mat& values) const {
    cv::Mat sum;
    cv::GaussianBlur(values.mul(weight_), sum, {}, kAround);
    return (values - sum / around_).mul(weight_);
  }

  float scale_;
  float across_ = 1.0f;
  cv::Mat weight_, around_, image_, spread_;  // image_ CV_32FC4: colour and cover
  std::array<cv::Mat, 3> y_less_;
};

}  // namespace

cv::Vec3f mirroredRadiance(const Appearance& appearance, const Light& light, const Look& look,
                           const SurfacePoint& point) {
  const cv::Vec3f albedo = (look.albedo ? *look.albedo : appearance.albedoAt(point))
                               .mul(look.tint.value_or(cv::Vec3f(1, 1, 1)));
  return appearance.radiance(
      albedo, diffuseShading(light, point.normal, 1.0f, point.sky, appearance.tint), {});
}

MirrorImage mirrorImage(const std::vector<const Actor*>& actors, const Radiance& radiance,
                        const std::vector<SupportPlane>& planes, const Camera& camera,
                        const cv::Mat& off) {
  MirrorImage image;
  const PlaneView view(planes, camera);
  cv::Mat near = cv::Mat::zeros(camera.height, camera.width, CV_32F);
  for (const SupportPlane& plane : planes) {
    if (plane.normal.dot(camera.world_from_camera.translation()) > plane.offset)
      addPlane(actors, radiance, view, plane, camera, off, image, near);
  }
  if (!image.empty()) findSpread(view, camera, near, image);
  return image;
}

cv::Mat addedBy(const PlaneMirror& mirror, const MirrorImage& image) {
  const cv::Mat drawn = DrawnOut(image.spread, image.across, mirror.slope)(withCover(image));
  cv::Mat added(drawn.size(), CV_32FC3);
#pragma omp parallel for schedule(static)
  for (int v = 0; v < added.rows; ++v) {
    for (int u = 0; u < added.cols; ++u) {
      const cv::Vec4f& c = drawn.at<cv::Vec4f>(v, u);
      added.at<cv::Vec3f>(v, u) =
          mirror.strength * (cv::Vec3f(c[0], c[1], c[2]) - c[3] * mirror.surroundings);
    }
  }
  return added;
}

cv::Mat unmirrored(const PlaneMirror& mirror, const cv::Mat& picture) {
  cv::Mat out = picture.clone();
#pragma omp parallel for schedule(static)
  for (int v = 0; v < out.rows; ++v) {
    for (int u = 0; u < out.cols; ++u) {
      const cv::Vec3f& added = mirror.at_key.at<cv::Vec3f>(v, u);
      if (added == cv::Vec3f()) continue;
      cv::Vec3f& c = out.at<cv::Vec3f>(v, u);
      for (int k = 0; k < 3; ++k)
        c[k] = codeFromLinear(std::max(0.0f, linearFromRealCode(c[k]) - added[k]));
    }
  }
  return out;
}

cv::Mat unmirroredCodes(const PlaneMirror& mirror, const cv::Mat& bgr) {
  cv::Mat out = bgr.clone();
#pragma omp parallel for schedule(static)
  for (int v = 0; v < out.rows; ++v) {
    for (int u = 0; u < out.cols; ++u) {
      const cv::Vec3f& added = mirror.at_key.at<cv::Vec3f>(v, u);
      if (added == cv::Vec3f()) continue;
      cv::Vec3b& c = out.at<cv::Vec3b>(v, u);
      for (int k = 0; k < 3; ++k) c[k] = quantise(codeFromLinear(linearFromCode(c[k]) - added[k]));
    }
  }
  return out;
}

PlaneMirror establishMirror(const MirrorImage& image, const cv::Mat& picture,
                            const cv::Mat& known) {
  const Trial trial(image, picture, known);
  Trial::Fit best;
  cv::Mat best_drawn;
  PlaneMirror mirror;
  for (const float slope : kSlopes) {
    const cv::Mat drawn = trial.drawnOut(slope);
    const Trial::Fit fit = trial.fit(drawn, 0);
    if (best.cover.empty() || fit.explained > best.explained)
      best = fit, best_drawn = drawn, mirror.slope = slope;
  }
  if (best.explained < kExplained * trial.squares() || !best.plausible()) return mirror;
  double others = 0.0, elsewhere = 0.0;
  int count = 0;
  for (int by = -kFarthest; by <= kFarthest; ++by) {
    if (by == 0) continue;
    const Trial::Fit fit = trial.fit(best_drawn, by);
    if (std::abs(by) > kMisplaced) elsewhere = std::max(elsewhere, fit.explained);
    if (fit.alike(best) > kAlike) continue;
    if (fit.plausible()) others = std::max(others, fit.explained);
    ++count;
  }
  if (count < kFewestOthers || best.explained < kClear * others || best.explained < elsewhere)
    return mirror;
  mirror.strength = static_cast<float>(best.x[0]);
  for (int c = 0; c < 3; ++c)
    mirror.surroundings[c] = static_cast<float>(best.x[c + 1] / best.x[0]);
  return mirror;
}

}  // namespace calipso::render
