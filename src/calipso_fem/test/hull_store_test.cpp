#include "calipso_fem/world/hull_store.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <future>
#include <stdexcept>
#include <utility>

#include "world_fixtures.hpp"

namespace calipso::fem {
namespace {

TriangleMesh box(double width) { return test::boxSurface({width, 0.1, 0.1}, 1); }

// Decomposes into the mesh itself and notes in which threads.
struct Recorder {
  std::vector<std::thread::id> threads;
  HullStore::Decompose decompose() {
    return [this](const TriangleMesh& mesh) {
      threads.push_back(std::this_thread::get_id());
      return std::vector<TriangleMesh>{mesh};
    };
  }
};

TEST(HullStore, DecomposesEachMeshOnce) {
  Recorder recorder;
  HullStore store(recorder.decompose());
  const auto& one = store.of(box(0.1));
  store.of(box(0.2));
  EXPECT_EQ(&store.of(box(0.1)), &one);
  EXPECT_EQ(one.front().vertices, box(0.1).vertices);
  EXPECT_EQ(recorder.threads.size(), 2u);
}

TEST(HullStore, DecomposesAheadInAnotherThread) {
  Recorder recorder;
  std::promise<void> last;
  const auto note = recorder.decompose();
  HullStore store([&](const TriangleMesh& mesh) {
    if (mesh.vertices == box(0.3).vertices) last.set_value();
    return note(mesh);
  });
  store.prepare({box(0.1), box(0.2), box(0.1), box(0.3)});
  ASSERT_EQ(last.get_future().wait_for(std::chrono::seconds(60)), std::future_status::ready);
  for (const double width : {0.1, 0.2, 0.3})
    EXPECT_EQ(store.of(box(width)).front().vertices, box(width).vertices);
  ASSERT_EQ(recorder.threads.size(), 3u);
  for (const auto& thread : recorder.threads) EXPECT_NE(thread, std::this_thread::get_id());
}

TEST(HullStore, WhatFailsAheadFailsWhereItIsNeeded) {
  std::promise<void> tried;
  bool first = true;  // one mesh is never decomposed twice at a time
  HullStore store([&](const TriangleMesh&) -> std::vector<TriangleMesh> {
    if (std::exchange(first, false)) tried.set_value();
    throw std::invalid_argument("no volume");
  });
  store.prepare({box(0.1)});
  ASSERT_EQ(tried.get_future().wait_for(std::chrono::seconds(60)), std::future_status::ready);
  EXPECT_THROW(store.of(box(0.1)), std::invalid_argument);
}

}  // namespace
}  // namespace calipso::fem
