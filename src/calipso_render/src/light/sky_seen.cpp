#include "light/sky_seen.hpp"

#include <Eigen/Dense>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <optional>

#include "draw/ray_scene.hpp"

namespace calipso::render {
namespace {

constexpr float kGoldenAngle = 2.39996323f;
constexpr int kRayBudget = 120000;  // for a whole mesh
constexpr int kFewestRays = 12, kMostRays = 48;
constexpr float kEven = 0.02f;  // of the fit of V: weight of no slope, as a part of all rays

// Place of ray k in the unit disc below the hemisphere.
Eigen::Vector2f discPlace(int k, int rays) {
  const float r = std::sqrt((k + 0.5f) / rays), a = k * kGoldenAngle;
  return {r * std::cos(a), r * std::sin(a)};
}

using Fit = Eigen::Matrix<float, 6, Eigen::Dynamic>;

// Least squares of values by rays as 1, x, y, x^2 - y^2, 2 x y, x^2 + y^2: one row per coefficient.
Fit polynomialFit(int rays) {
  Fit basis(6, rays);
  for (int k = 0; k < rays; ++k) {
    const Eigen::Vector2f p = discPlace(k, rays);
    const float x = p.x(), y = p.y();
    basis.col(k) << 1.0f, x, y, x * x - y * y, 2.0f * x * y, x * x + y * y;
  }
  Eigen::Matrix<float, 6, 6> normal = basis * basis.transpose();
  normal.diagonal().tail<5>().array() += kEven * static_cast<float>(rays);
  return normal.ldlt().solve(basis);
}

// Rays from one side of every vertex, evenly spread over the disc below its hemisphere: the cosine
// weighs by itself (Malley).
class Side {
 public:
  Side(const RayScene& scene, const Points& vertices, const Points& normals, float side)
      : rays_(std::clamp(kRayBudget / std::max(1, static_cast<int>(vertices.size())), kFewestRays,
                         kMostRays)),
        hits_(vertices.size() * rays_),
        fit_(polynomialFit(rays_)) {
    seen.resize(vertices.size());
#pragma omp parallel for schedule(dynamic, 64)
    for (std::size_t i = 0; i < vertices.size(); ++i) {
      const Eigen::Vector3f n = side * normals[i];
      seen[i] = SkySeen::all(n);
      if (n.squaredNorm() > 0.5f) follow(scene, vertices[i], n, static_cast<int>(i));
    }
  }

  // Light that comes back from what the rays met.
  // @param behind the mesh's other side; nullptr: none is ever seen
  void gather(const Triangles& triangles, const std::vector<SkySeen>& front,
              const std::vector<SkySeen>* behind) {
    const float part = 1.0f / static_cast<float>(rays_);
#pragma omp parallel for schedule(static)
    for (std::size_t i = 0; i < seen.size(); ++i) {
      for (int k = 0; k < rays_; ++k) {
        const std::optional<RayScene::Hit>& hit = hits_[i * rays_ + k];
        if (!hit || (hit->behind && behind == nullptr)) continue;
        const Eigen::Vector3i& t = triangles[hit->triangle];
        const std::vector<SkySeen>& there = hit->behind ? *behind : front;
        const float u = 1.0f - hit->v - hit->w;
        for (const auto& [corner, weight] :
             {std::pair{t[0], u}, std::pair{t[1], hit->v}, std::pair{t[2], hit->w}}) {
          seen[i].thrown += part * weight * there[corner].open;
          seen[i].thrown_towards += part * weight * there[corner].towards;
        }
      }
    }
  }

  std::vector<SkySeen> seen;

 private:
  void follow(const RayScene& scene, const Eigen::Vector3f& p, const Eigen::Vector3f& n, int i) {
    const Eigen::Vector3f s = n.unitOrthogonal(), t = n.cross(s);
    Eigen::Matrix<float, 6, 1> hidden = Eigen::Matrix<float, 6, 1>::Zero();
    for (int k = 0; k < rays_; ++k) {
      const Eigen::Vector2f q = discPlace(k, rays_);
      const Eigen::Vector3f d =
          q.x() * s + q.y() * t + std::sqrt(std::max(0.0f, 1.0f - q.squaredNorm())) * n;
      std::optional<RayScene::Hit>& hit = hits_[static_cast<std::size_t>(i) * rays_ + k];
      hit = scene.hit(p, n, d);
      if (!hit) continue;
      // Taken off what the whole hemisphere gives, which is exact where nothing is in the way.
      seen[i].open -= 1.0f / static_cast<float>(rays_);
      seen[i].towards -= 1.5f / static_cast<float>(rays_) * d;
      hidden += fit_.col(k);
    }
    seen[i].level -= hidden[0];
    seen[i].slope -= hidden[1] * s + hidden[2] * t;
    const Eigen::Matrix3f ss = s * s.transpose(), tt = t * t.transpose(), st = s * t.transpose();
    seen[i].curve -=
        hidden[3] * (ss - tt) + hidden[4] * (st + st.transpose()) + hidden[5] * (ss + tt);
  }

  int rays_;
  std::vector<std::optional<RayScene::Hit>> hits_;
  Fit fit_;
};

}  // namespace

void findSkySeen(const Points& vertices, const Points& normals, const Triangles& triangles,
                 bool open, std::vector<SkySeen>& seen, std::vector<SkySeen>& behind) {
  const RayScene scene({{&vertices, &triangles}});
  Side front(scene, vertices, normals, 1.0f);
  behind.clear();
  if (open) {
    Side back(scene, vertices, normals, -1.0f);
    const std::vector<SkySeen> straight = front.seen, straight_behind = back.seen;
    front.gather(triangles, straight, &straight_behind);
    back.gather(triangles, straight, &straight_behind);
    behind = std::move(back.seen);
  } else {
    const std::vector<SkySeen> straight = front.seen;
    front.gather(triangles, straight, nullptr);
  }
  seen = std::move(front.seen);
}

}  // namespace calipso::render
