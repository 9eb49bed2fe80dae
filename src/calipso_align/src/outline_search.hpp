#pragma once

#include <Eigen/Core>
#include <limits>
#include <vector>

namespace calipso::align {

// A point of the image plane with its normal, scaled for the search: (u, v, s nu, s nv).
struct Feature {
  float u, v, nu, nv;
};

constexpr float kUnset = std::numeric_limits<float>::quiet_NaN();
constexpr Feature kNowhere = {kUnset, kUnset, kUnset, kUnset};  // pairs with nothing

Feature featureOf(const Eigen::Vector2d& pixel, const Eigen::Vector2d& normal, double scale);

// Finds nearest points that look the same way. Immutable: any number of threads may ask.
class OutlineSearch {
 public:
  // reject_px: points farther apart are no pair; reject_turn: the same for scaled normals
  OutlineSearch(const std::vector<Feature>& candidates, float reject_px, float reject_turn);

  // Index of the candidate with the least squared distance of pixels and scaled normals together,
  // the first of equal ones; -1 for none.
  int nearest(const Feature& query) const;

 private:
  struct Best {
    float squared_distance;
    int index;
  };
  void searchCell(int column, int row, const Feature& query, Best& best) const;

  float cell_px_ = 1.0f, reject_, reject_turn_;
  float u0_ = 0.0f, v0_ = 0.0f;
  int columns_ = 0, rows_ = 0;
  std::vector<int> start_;         // of each cell's candidates; one more at the end
  std::vector<Feature> features_;  // sorted by cell, by index within a cell
  std::vector<int> index_;
};

}  // namespace calipso::align
