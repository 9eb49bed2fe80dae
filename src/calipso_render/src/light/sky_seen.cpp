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
constexpr int kSteps = 2;  // along the sides of a triangle with a buried corner, between samples
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
    seen.resize(vertices.size()), buried.resize(vertices.size(), 0);
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
  std::vector<char> buried;  // it looks at the backs of triangles: another shell is around it

 private:
  void follow(const RayScene& scene, const Eigen::Vector3f& p, const Eigen::Vector3f& n, int i) {
    const Eigen::Vector3f s = n.unitOrthogonal(), t = n.cross(s);
    Eigen::Matrix<float, 6, 1> hidden = Eigen::Matrix<float, 6, 1>::Zero();
    int backs = 0;
    for (int k = 0; k < rays_; ++k) {
      const Eigen::Vector2f q = discPlace(k, rays_);
      const Eigen::Vector3f d =
          q.x() * s + q.y() * t + std::sqrt(std::max(0.0f, 1.0f - q.squaredNorm())) * n;
      std::optional<RayScene::Hit>& hit = hits_[static_cast<std::size_t>(i) * rays_ + k];
      hit = scene.hit(p, n, d);
      if (!hit) continue;
      backs += hit->behind ? 1 : 0;
      // Taken off what the whole hemisphere gives, which is exact where nothing is in the way.
      seen[i].open -= 1.0f / static_cast<float>(rays_);
      seen[i].towards -= 1.5f / static_cast<float>(rays_) * d;
      hidden += fit_.col(k);
    }
    buried[i] = 2 * backs > rays_ ? 1 : 0;
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

// Where shells of one mesh run into each other (a beam in a pier), vertices within another shell
// see nothing, but the triangles they belong to come out of it: there is what they stand for.
class Emergence {
 public:
  Emergence(const Points& vertices, const Points& normals, const Triangles& triangles,
            const std::vector<char>& buried) {
    for (const Eigen::Vector3i& t : triangles) {
      if (buried[t[0]] + buried[t[1]] + buried[t[2]] == 0) continue;
      for (int i = 0; i <= kSteps; ++i) {
        for (int j = 0; i + j <= kSteps; ++j) {
          const Eigen::Vector3f w = Eigen::Vector3f(i, j, kSteps - i - j) / kSteps;
          if (w.maxCoeff() == 1.0f) continue;
          samples_.push_back({t, w});
          places.push_back(w[0] * vertices[t[0]] + w[1] * vertices[t[1]] + w[2] * vertices[t[2]]);
          this->normals.push_back(
              (w[0] * normals[t[0]] + w[1] * normals[t[1]] + w[2] * normals[t[2]]).normalized());
        }
      }
    }
  }

  // Gives the buried vertices what the samples outside see, near ones most; those that have none an
  // open view: nobody sees them until they come out.
  // @param normals of the vertices
  void spread(const Side& samples, const Points& normals, const std::vector<char>& buried,
              std::vector<SkySeen>& seen) const {
    std::vector<SkySeen> sums(seen.size(), SkySeen::none());
    std::vector<float> weights(seen.size(), 0.0f);
    for (std::size_t k = 0; k < samples_.size(); ++k) {
      if (samples.buried[k] != 0) continue;
      for (int i = 0; i < 3; ++i) {
        const int vertex = samples_[k].corners[i];
        const float weight = samples_[k].weights[i] * samples_[k].weights[i];
        sums[vertex] = sums[vertex] + samples.seen[k] * weight, weights[vertex] += weight;
      }
    }
    for (std::size_t i = 0; i < seen.size(); ++i) {
      if (buried[i] == 0) continue;
      seen[i] = weights[i] > 0.0f ? sums[i] * (1.0f / weights[i]) : SkySeen::all(normals[i]);
    }
  }

  Points places, normals;

 private:
  struct Sample {
    Eigen::Vector3i corners;
    Eigen::Vector3f weights;
  };
  std::vector<Sample> samples_;
};

// Of an open mesh a place that looks at backs is within another shell only if nothing is seen from
// its other side either.
void leaveOpen(const Side& back, Side& front) {
  constexpr float kHidden = 0.1f;  // of the light
  for (std::size_t i = 0; i < front.buried.size(); ++i)
    front.buried[i] = front.buried[i] != 0 && back.seen[i].open < kHidden ? 1 : 0;
}

Points negated(Points normals) {
  for (Eigen::Vector3f& n : normals) n = -n;
  return normals;
}

}  // namespace

void findSkySeen(const Points& vertices, const Points& normals, const Triangles& triangles,
                 bool open, std::vector<SkySeen>& seen, std::vector<SkySeen>& behind) {
  const RayScene scene({{&vertices, &triangles}});
  Side front(scene, vertices, normals, 1.0f);
  behind.clear();
  if (open) {
    const Points turned = negated(normals);
    Side back(scene, vertices, normals, -1.0f);
    leaveOpen(back, front);
    const Emergence emergence(vertices, normals, triangles, front.buried);
    Side outside(scene, emergence.places, emergence.normals, 1.0f),
        inside(scene, emergence.places, emergence.normals, -1.0f);
    leaveOpen(inside, outside), inside.buried = outside.buried;
    const auto spread = [&] {
      emergence.spread(outside, normals, front.buried, front.seen);
      emergence.spread(inside, turned, front.buried, back.seen);
    };
    spread();
    const std::vector<SkySeen> straight = front.seen, straight_behind = back.seen;
    for (Side* side : {&front, &back, &outside, &inside})
      side->gather(triangles, straight, &straight_behind);
    spread();
    behind = std::move(back.seen);
  } else {
    const Emergence emergence(vertices, normals, triangles, front.buried);
    Side outside(scene, emergence.places, emergence.normals, 1.0f);
    emergence.spread(outside, normals, front.buried, front.seen);
    const std::vector<SkySeen> straight = front.seen;
    front.gather(triangles, straight, nullptr), outside.gather(triangles, straight, nullptr);
    emergence.spread(outside, normals, front.buried, front.seen);
  }
  seen = std::move(front.seen);
}

}  // namespace calipso::render
