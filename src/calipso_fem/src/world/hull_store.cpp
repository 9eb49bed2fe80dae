#include "calipso_fem/world/hull_store.hpp"

#include <omp.h>

#include <cassert>
#include <mutex>

namespace calipso::fem {

struct HullStore::Entry {
  explicit Entry(TriangleMesh m) : mesh(std::move(m)) {}

  void fill(const Decompose& decompose) {
    std::call_once(once, [&] { hulls = decompose(mesh); });
  }

  const TriangleMesh mesh;
  std::once_flag once;
  std::vector<TriangleMesh> hulls;
};

HullStore::~HullStore() {
  stop_ = true;
  if (ahead_.joinable()) ahead_.join();
}

void HullStore::prepare(const std::vector<TriangleMesh>& meshes) {
  assert(!ahead_.joinable());
  std::vector<std::shared_ptr<Entry>> wanted;
  for (const TriangleMesh& mesh : meshes) wanted.push_back(entryOf(mesh));
  ahead_ = std::thread([this, wanted] {
    omp_set_num_threads(1);  // the other cores are the video's
    for (const auto& entry : wanted) {
      if (stop_) return;
      try {
        entry->fill(decompose_);
      } catch (const std::exception&) {  // is thrown again where the hulls are needed
      }
    }
  });
}

const std::vector<TriangleMesh>& HullStore::of(const TriangleMesh& mesh) {
  const std::shared_ptr<Entry> entry = entryOf(mesh);
  entry->fill(decompose_);
  return entry->hulls;
}

std::shared_ptr<HullStore::Entry> HullStore::entryOf(const TriangleMesh& mesh) {
  const auto same = [](const auto& a, const auto& b) {
    return a.rows() == b.rows() && (a.array() == b.array()).all();
  };
  for (const auto& entry : entries_)
    if (same(entry->mesh.vertices, mesh.vertices) && same(entry->mesh.triangles, mesh.triangles))
      return entry;
  return entries_.emplace_back(std::make_shared<Entry>(mesh));
}

}  // namespace calipso::fem
