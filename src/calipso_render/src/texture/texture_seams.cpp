#include "texture/texture_seams.hpp"

#include <algorithm>
#include <cmath>

#include "calipso_render/colour.hpp"
#include "texture/mesh_topology.hpp"

namespace calipso::render {
namespace {

constexpr float kFewest = 0.5f;    // texels at a vertex that tell the colour of a part there
constexpr float kLargest = 0.35f;  // step, of the brighter side, that differing light explains
constexpr float kDarkest = 0.01f;  // brightness from which on steps are told

// Mean colours of a part at the vertices that it reaches.
struct Part {
  std::vector<cv::Vec3f> colour;
  std::vector<float> texels;

  explicit Part(std::size_t vertices) : colour(vertices), texels(vertices, 0.0f) {}
  bool reaches(std::size_t vertex) const { return texels[vertex] >= kFewest; }
};

std::vector<Part> partsAtVertices(const std::vector<int>& welded, const Triangles& triangles,
                                  const std::vector<signed char>& part,
                                  const SurfaceTexture& texture) {
  const int count = 1 + std::max<int>(0, *std::max_element(part.begin(), part.end()));
  std::vector<Part> parts(count, Part(welded.size()));
  for (int t = 0; t < texture.triangleCount(); ++t) {
    for (std::size_t i = texture.firstOf(t); i < texture.firstOf(t + 1); ++i) {
      if (part[i] < 0) continue;
      const Eigen::Vector3f w = texture.weightsOf(t, i - texture.firstOf(t));
      const cv::Vec4f& c = texture.texels[i];
      for (int k = 0; k < 3; ++k) {
        const int vertex = welded[triangles[t][k]];
        parts[part[i]].colour[vertex] += w[k] * cv::Vec3f(c[0], c[1], c[2]),
            parts[part[i]].texels[vertex] += w[k];
      }
    }
  }
  for (Part& p : parts) {
    for (std::size_t v = 0; v < p.colour.size(); ++v) {
      if (p.texels[v] > 0.0f) p.colour[v] *= 1.0f / p.texels[v];
    }
  }
  return parts;
}

float logBrightness(const cv::Vec3f& colour) {
  return std::log(std::max(luminance(colour), kDarkest));
}

// By how much, in logarithms, part `own` is to become brighter at a vertex where others meet it that
// differ from it by their light. The seen part keeps its brightness, others meet in the middle.
// @return whether there is a step to be evened out
bool stepsAt(const std::vector<Part>& parts, int own, std::size_t vertex, float& by) {
  if (!parts[own].reaches(vertex)) return false;
  const cv::Vec3f& colour = parts[own].colour[vertex];
  const auto continues = [&](const Part& other) {
    const cv::Vec3f& c = other.colour[vertex];
    return other.reaches(vertex) &&
           cv::norm(c - colour) <= kLargest * std::max(cv::norm(c), cv::norm(colour));
  };
  if (continues(parts[0])) {
    by = logBrightness(parts[0].colour[vertex]) - logBrightness(colour);
    return true;
  }
  cv::Vec3f sum;
  float total = 0.0f;
  for (const Part& other : parts) {
    if (!continues(other)) continue;
    sum += other.texels[vertex] * other.colour[vertex], total += other.texels[vertex];
  }
  by = logBrightness(sum / total) - logBrightness(colour);
  return total > parts[own].texels[vertex];
}

// The triangles that have texels of a part: nothing else reads its shift.
Triangles trianglesWith(int own, const Triangles& triangles, const std::vector<signed char>& part,
                        const SurfaceTexture& texture) {
  Triangles with;
  for (int t = 0; t < texture.triangleCount(); ++t) {
    const auto first = part.begin() + static_cast<std::ptrdiff_t>(texture.firstOf(t)),
               last = part.begin() + static_cast<std::ptrdiff_t>(texture.firstOf(t + 1));
    if (std::find(first, last, own) != last) with.push_back(triangles[t]);
  }
  return with;
}

}  // namespace

void levelSeams(const Points& vertices, const Triangles& triangles,
                const std::vector<signed char>& part, SurfaceTexture& texture) {
  if (part.empty()) return;
  const std::vector<int> welded = weld(vertices);
  const std::vector<Part> parts = partsAtVertices(welded, triangles, part, texture);
  std::vector<std::vector<cv::Vec3f>> shifts(parts.size());
#pragma omp parallel for schedule(dynamic, 1)
  for (std::size_t own = 1; own < parts.size(); ++own) {
    std::vector<cv::Vec3f> shift(vertices.size());
    std::vector<bool> known(vertices.size(), false);
    for (std::size_t v = 0; v < vertices.size(); ++v) {
      float by = 0.0f;
      known[v] = stepsAt(parts, static_cast<int>(own), welded[v], by);
      shift[v] = cv::Vec3f::all(by);
    }
    if (std::find(known.begin(), known.end(), true) == known.end()) continue;
    diffuseOverMesh(vertices, trianglesWith(static_cast<int>(own), triangles, part, texture), known,
                    shift);
    shifts[own] = std::move(shift);
  }
  for (int t = 0; t < texture.triangleCount(); ++t) {
    for (std::size_t i = texture.firstOf(t); i < texture.firstOf(t + 1); ++i) {
      if (part[i] <= 0 || shifts[part[i]].empty()) continue;
      const std::vector<cv::Vec3f>& shift = shifts[part[i]];
      const Eigen::Vector3f w = texture.weightsOf(t, i - texture.firstOf(t));
      const float by = w[0] * shift[triangles[t][0]][0] + w[1] * shift[triangles[t][1]][0] +
                       w[2] * shift[triangles[t][2]][0];
      for (int c = 0; c < 3; ++c) texture.texels[i][c] *= std::exp(by);
    }
  }
}

}  // namespace calipso::render
