// Contact cases with known answers, on the simulator's own code. Without arguments all of them run;
// with arguments, those named; a folder is a scene with its truth (scenes/FORMAT.md). Prints one
// JSON object per result.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iostream>
#include <sstream>
#include <stdexcept>

#include "../../src/world/obstacle_query.hpp"
#include "calipso_scene/help.hpp"
#include "contact_cases.hpp"

namespace calipso::fem {

void Run::play(World& world, double seconds, const std::function<void(const WorldState&)>& look) {
  const double start = world.time();
  for (int k = 1; k <= std::lround(seconds / period); ++k) {
    const double before = processMs(), wall_before = wallMs();
    world.advanceTo(start + k * period);
    const double took = processMs() - before, wall = wallMs() - wall_before;
    const WorldState state = world.state();
    for (const ContactPoint& c : state.contacts) deepest = std::max(deepest, c.depth);
    ms += took;
    slowest_ms = std::max(slowest_ms, took);
    wall_ms += wall;
    slowest_wall_ms = std::max(slowest_wall_ms, wall);
    ++frames;
    if (look) look(state);
  }
}

double deepestOverlap(const std::vector<TriangleMesh>& surfaces) {
  constexpr double kReach = 0.1;  // m
  double deepest = 0.0;
  for (const TriangleMesh& other : surfaces) {
    deepest = std::max(deepest, -other.vertices.col(2).minCoeff());
    const SurfaceTree tree(other);
    for (const TriangleMesh& one : surfaces)
      for (int v = 0; &one != &other && v < one.vertexCount(); ++v) {
        if (!encloses(other, one.vertex(v))) continue;
        if (const auto hit = tree.nearest(one.vertex(v), kReach))
          deepest = std::max(deepest, -hit->distance);
      }
  }
  return deepest;
}

namespace {

std::string number(double value) {
  if (!std::isfinite(value)) return "null";
  std::ostringstream text;
  text << value;
  return text.str();
}

void print(const std::string& name, const Result& r) {
  const double scale = std::abs(r.reference) > 0.0 ? std::abs(r.reference) : 1.0;
  std::cout << "{\"case\": \"" << name << "\", \"quantity\": \"" << r.quantity
            << "\", \"value\": " << number(r.value) << ", \"reference\": " << number(r.reference)
            << ", \"rel_error\": " << number(std::abs(r.value - r.reference) / scale)
            << ", \"max_penetration_ratio\": " << number(r.penetration_ratio)
            << ", \"energy_growth\": " << number(r.energy_growth)
            << ", \"ms_per_frame\": " << number(r.ms_per_frame) << "}" << std::endl;
}

Cases allCases() {
  Cases all;
  for (const Cases& part :
       {analyticCases(), momentumCases(), hardCases(), selfCases(), speedCases(), bulletCases()})
    all.insert(part.begin(), part.end());
  return all;
}

void run(const Cases& cases, const std::string& name) {
  std::vector<Result> results;
  const auto found = cases.find(name);
  if (found != cases.end()) {
    results = found->second();
  } else if (std::filesystem::is_directory(name)) {
    results = sceneCase(name);
  } else {
    std::string known;
    for (const auto& entry : cases) known += " " + entry.first;
    throw std::invalid_argument("no contact case or scene folder '" + name + "'; cases:" + known);
  }
  for (const Result& result : results) print(name, result);
}

}  // namespace
}  // namespace calipso::fem

int main(int argc, char** argv) {
  const calipso::fem::Cases cases = calipso::fem::allCases();
  std::string known =
      "usage: evaluate_contact [CASE | SCENE_FOLDER]...   (default: all cases)\ncases:";
  for (const auto& entry : cases) known += " " + entry.first;
  calipso::helpIfAsked(argc, argv, known + "\n");
  std::vector<std::string> names(argv + 1, argv + argc);
  if (names.empty())
    for (const auto& entry : cases) names.push_back(entry.first);
  try {
    for (const std::string& name : names) calipso::fem::run(cases, name);
    return 0;
  } catch (const std::exception& error) {
    std::cerr << "evaluate_contact: " << error.what() << std::endl;
    return 1;
  }
}
