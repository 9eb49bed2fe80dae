#include <algorithm>
#include <array>
#include <calipso_scene/disjoint_sets.hpp>
#include <map>

#include "voxel_cells.hpp"

namespace calipso::fem {
namespace {

using Eigen::Vector3i;

using Position = std::array<int, 3>;  // z, y, x: maps then run in lattice order

Position key(const Vector3i& p) { return {p.z(), p.y(), p.x()}; }

Vector3i cornerOffset(int c) { return {c & 1, (c >> 1) & 1, c >> 2}; }

using CellsAt = std::map<Position, std::vector<int>>;

CellsAt cellsAt(const std::vector<CoveredCell>& cells) {
  CellsAt at;
  for (std::size_t c = 0; c < cells.size(); ++c)
    at[key(cells[c].position)].push_back(static_cast<int>(c));
  return at;
}

// Joins the four corners that the two cells share.
void joinFace(const FaceContact& contact, DisjointSets* sets) {
  for (int c = 0; c < 8; ++c)
    if (cornerOffset(c)[contact.axis] == 1)
      sets->join(8 * contact.low + c, 8 * contact.high + (c ^ (1 << contact.axis)));
}

}  // namespace

std::vector<FaceContact> faceContacts(const std::vector<CoveredCell>& cells) {
  const CellsAt at_position = cellsAt(cells);
  std::vector<FaceContact> contacts;
  for (int a = 0; a < static_cast<int>(cells.size()); ++a)
    for (int axis = 0; axis < 3; ++axis) {
      const auto it = at_position.find(key(cells[a].position + Vector3i::Unit(axis)));
      if (it == at_position.end()) continue;
      for (int b : it->second) {
        const bool touch = (cells[a].neighbours[2 * axis + 1] >> cells[b].branch & 1u) ||
                           (cells[b].neighbours[2 * axis] >> cells[a].branch & 1u);
        if (touch) contacts.push_back({a, b, axis});
      }
    }
  return contacts;
}

CornerNumbering numberCorners(const std::vector<CoveredCell>& cells) {
  const int n = static_cast<int>(cells.size());
  const CellsAt at_position = cellsAt(cells);
  DisjointSets sets(8 * n);
  for (const FaceContact& contact : faceContacts(cells)) joinFace(contact, &sets);

  // Around a node without divided cells everything is one, also across an edge or a corner.
  std::map<Position, std::vector<int>> corners_at;
  for (int k = 0; k < 8 * n; ++k)
    corners_at[key(cells[k / 8].position + cornerOffset(k % 8))].push_back(k);
  for (const auto& [position, corners] : corners_at) {
    const bool divided = std::any_of(corners.begin(), corners.end(), [&](int k) {
      return at_position.at(key(cells[k / 8].position)).size() > 1;
    });
    if (divided) continue;
    for (int k : corners) sets.join(corners.front(), k);
  }

  CornerNumbering numbering;
  numbering.hexes.resize(n, 8);
  std::vector<int> id(8 * n, -1);
  std::vector<Vector3i> lattice;
  for (const auto& [position, corners] : corners_at)
    for (int k : corners) {
      int& node = id[sets.find(k)];
      if (node < 0) {
        node = static_cast<int>(lattice.size());
        lattice.emplace_back(position[2], position[1], position[0]);
      }
      numbering.hexes(k / 8, k % 8) = node;
    }
  numbering.node_lattice.resize(lattice.size(), 3);
  for (std::size_t i = 0; i < lattice.size(); ++i) numbering.node_lattice.row(i) = lattice[i];
  return numbering;
}

}  // namespace calipso::fem
