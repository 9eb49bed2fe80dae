#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <thread>
#include <vector>

#include "calipso_scene/triangle_mesh.hpp"

namespace calipso::fem {

// The convex parts of meshes; each mesh is decomposed once. That takes up to a second, for which
// live video cannot wait: what an edit may need is decomposed beforehand, beside what else happens.
// One thread may call of().
class HullStore {
 public:
  using Decompose = std::function<std::vector<TriangleMesh>(const TriangleMesh&)>;

  explicit HullStore(Decompose decompose) : decompose_(std::move(decompose)) {}
  // Waits for the one mesh that is being decomposed.
  ~HullStore();
  HullStore(const HullStore&) = delete;
  HullStore& operator=(const HullStore&) = delete;

  // Decomposes these in a thread of its own, one after the other. At most once.
  void prepare(const std::vector<TriangleMesh>& meshes);

  // Valid as long as the store. Waits when the mesh is just being decomposed.
  // @throw what Decompose throws
  const std::vector<TriangleMesh>& of(const TriangleMesh& mesh);

 private:
  struct Entry;
  std::shared_ptr<Entry> entryOf(const TriangleMesh& mesh);

  Decompose decompose_;
  std::vector<std::shared_ptr<Entry>> entries_;
  std::atomic<bool> stop_ = false;
  std::thread ahead_;
};

}  // namespace calipso::fem
