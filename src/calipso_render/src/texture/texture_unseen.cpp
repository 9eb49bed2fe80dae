#include "texture/texture_unseen.hpp"

#include <algorithm>
#include <numeric>

#include "texture/mesh_topology.hpp"

namespace calipso::render {
namespace {

// certainty, of the greatest there is, of what others are continued from
constexpr float kKnown = 0.5f;
// of the extent: within it what is not seen goes over from the seen around it to the common colour
constexpr float kFromSeen = 0.1f;
constexpr std::size_t kLookedAt = 300;       // texels, for that
const cv::Vec3f kUnknown(0.3f, 0.3f, 0.3f);  // reflectance of an object that no picture shows

cv::Vec3f colourOf(const cv::Vec4f& c) { return {c[0], c[1], c[2]}; }

// The reflectance that most of them have: that of the one nearest to all others, with the quarter
// of them that is most like it.
cv::Vec3f commonColour(const std::vector<cv::Vec3f>& known) {
  std::vector<cv::Vec3f> some;
  const std::size_t step = (known.size() + kLookedAt - 1) / kLookedAt;
  for (std::size_t i = 0; i < known.size(); i += step) some.push_back(known[i]);
  const auto away = [](const cv::Vec3f& a, const cv::Vec3f& b) { return cv::norm(a - b); };
  cv::Vec3f middle;
  double least = 1e30;
  for (const cv::Vec3f& a : some) {
    double sum = 0.0;
    for (const cv::Vec3f& b : some) sum += away(a, b);
    if (sum < least) least = sum, middle = a;
  }
  const std::size_t quarter = (some.size() + 3) / 4;
  std::sort(some.begin(), some.end(), [&](const cv::Vec3f& a, const cv::Vec3f& b) {
    return away(a, middle) < away(b, middle);
  });
  return std::accumulate(some.begin(), some.begin() + quarter, cv::Vec3f()) *
         (1.0f / static_cast<float>(quarter));
}

// The common colour of each part; none where too little of it is known.
// @param part per triangle
std::vector<std::optional<cv::Vec3f>> commonColours(const std::vector<int>& part,
                                                    const std::vector<float>& certain,
                                                    const SurfaceTexture& texture) {
  const int count = 1 + *std::max_element(part.begin(), part.end());
  std::vector<std::vector<cv::Vec3f>> known(count);
  for (int t = 0; t < texture.triangleCount(); ++t) {
    for (std::size_t i = texture.firstOf(t); i < texture.firstOf(t + 1); ++i) {
      if (certain[i] >= 1.0f) known[part[t]].push_back(colourOf(texture.texels[i]));
    }
  }
  std::vector<std::optional<cv::Vec3f>> colours(count);
  for (int p = 0; p < count; ++p) {
    if (known[p].size() >= kFewestKnown) colours[p] = commonColour(known[p]);
  }
  return colours;
}

// What each vertex goes over to: the common colour of the smooth part of the surface that it
// belongs to, or else of all that hangs together with it, or else what is faintly seen of that, or
// else of the object.
std::vector<cv::Vec3f> commonAround(const Surface& surface, const std::vector<int>& pieces,
                                    const std::vector<int>& shells, const FaintColours& faint,
                                    const std::vector<float>& certain,
                                    const SurfaceTexture& texture) {
  const Triangles& triangles = surface.triangles;
  const auto of_piece = commonColours(pieces, certain, texture),
             of_shell = commonColours(shells, certain, texture),
             of_all = commonColours(std::vector<int>(triangles.size(), 0), certain, texture);
  std::vector<cv::Vec3f> sums(surface.key_vertices.size());
  std::vector<float> counts(sums.size(), 0.0f);
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    std::optional<cv::Vec3f> colour;
    for (const auto& of : {of_piece[pieces[t]], of_shell[shells[t]], faint[shells[t]], of_all[0]}) {
      if (!colour) colour = of;
    }
    for (int k = 0; k < 3; ++k)
      sums[triangles[t][k]] += colour.value_or(kUnknown), ++counts[triangles[t][k]];
  }
  for (std::size_t i = 0; i < sums.size(); ++i) {
    if (counts[i] > 0.0f) sums[i] *= 1.0f / counts[i];
  }
  return sums;
}

}  // namespace

void fillUnseen(const Surface& surface, const std::vector<int>& pieces,
                const std::vector<int>& shells, const FaintColours& faint,
                const std::vector<float>& certain, SurfaceTexture& texture) {
  const Triangles& triangles = surface.triangles;
  std::vector<cv::Vec3f> values(surface.key_vertices.size());
  std::vector<float> parts(values.size(), 0.0f), best(values.size(), 0.0f);
  for (int t = 0; t < texture.triangleCount(); ++t) {
    for (std::size_t i = texture.firstOf(t); i < texture.firstOf(t + 1); ++i) {
      Eigen::Index corner;
      const Eigen::Vector3f w = texture.weightsOf(t, i - texture.firstOf(t));
      w.maxCoeff(&corner);
      const int vertex = triangles[t][corner];
      values[vertex] += colourOf(texture.texels[i]) * certain[i], parts[vertex] += certain[i],
          best[vertex] = std::max(best[vertex], certain[i]);
    }
  }
  const float most = *std::max_element(best.begin(), best.end());
  std::vector<bool> known(values.size(), false);
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (parts[i] > 0.0f) values[i] *= 1.0f / parts[i], known[i] = best[i] >= kKnown * most;
  }
  if (most == 0.0f)
    std::fill(values.begin(), values.end(), kUnknown);
  else
    diffuseOverMesh(surface.key_vertices, triangles, known, values,
                    FarValues{commonAround(surface, pieces, shells, faint, certain, texture),
                              kFromSeen * boxOf(surface.key_vertices).diagonal().norm()});
  for (int t = 0; t < texture.triangleCount(); ++t) {
    for (std::size_t i = texture.firstOf(t); i < texture.firstOf(t + 1); ++i) {
      if (certain[i] >= 1.0f) continue;
      const Eigen::Vector3f w = texture.weightsOf(t, i - texture.firstOf(t));
      const cv::Vec3f around = values[triangles[t][0]] * w[0] + values[triangles[t][1]] * w[1] +
                               values[triangles[t][2]] * w[2];
      const cv::Vec3f c = certain[i] * colourOf(texture.texels[i]) + (1.0f - certain[i]) * around;
      texture.texels[i] = cv::Vec4f(c[0], c[1], c[2], certain[i] * texture.texels[i][3]);
    }
  }
}

}  // namespace calipso::render
