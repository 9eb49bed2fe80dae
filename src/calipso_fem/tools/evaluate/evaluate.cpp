// Runs reference cases (files or folders of JSON) through the finite element core and prints one
// JSON object per result. What cannot be read or solved is named on standard error, the rest goes
// on; the exit code is then 1.
#include <algorithm>
#include <filesystem>
#include <iostream>
#include <map>

#include "calipso_scene/help.hpp"
#include "reference_cases.hpp"

namespace calipso::fem {
namespace {

std::vector<std::string> caseFiles(const std::string& path) {
  namespace fs = std::filesystem;
  if (!fs::exists(path)) throw std::runtime_error(path + ": no such file or folder");
  if (!fs::is_directory(path)) return {path};
  std::vector<std::string> files;
  for (const auto& entry : fs::directory_iterator(path))
    if (entry.path().extension() == ".json") files.push_back(entry.path().string());
  std::sort(files.begin(), files.end());
  if (files.empty()) throw std::runtime_error(path + ": holds no .json file");
  return files;
}

void evaluateFile(const std::string& path) {
  using Evaluator = void (*)(const CaseFile&);
  static const std::map<std::string, Evaluator> kFamilies = {
      {"A", evaluateBoxLoads},    {"B", evaluateBoxLoads}, {"C", evaluateTorsion},
      {"D", evaluateHomogeneous}, {"E", evaluateCook},     {"F", evaluateDynamics},
      {"G", evaluateModes},       {"H", evaluateBoxLoads}, {"I", evaluateShapes},
      {"J", evaluateElements}};
  const CaseFile file = readCase(path);
  const std::string family = readText(file, file.root, "family");
  const auto it = kFamilies.find(family);
  if (it == kFamilies.end())
    throw std::runtime_error(path + ": family '" + family + "' is unknown; known are A to J");
  it->second(file);
}

}  // namespace

ElementType referenceElement(const std::string& name) {
  if (name == "Q1") return ElementType::kHexQ1;
  if (name == "P1") return ElementType::kTetP1;
  throw std::runtime_error("element '" + name + "' of a reference case: known are Q1 and P1");
}

FemOptions exactOptions(MaterialModel model, ElementType element) {
  FemOptions options;
  options.material_model = model;
  options.element = element;
  options.newton_iterations = 60;
  options.newton_tolerance = 1e-10;
  options.linear_tolerance = 1e-11;
  options.solver = SolverKind::kCholesky;
  return options;
}

void addReport(const StepReport& report, ResultLine* line) {
  line->steps += 1;
  line->ms_per_step += report.milliseconds;
  line->newton_iterations += report.newton_iterations;
  line->cg_iterations += report.linear_iterations;
  line->solver = report.solver;
}

}  // namespace calipso::fem

int main(int argc, char** argv) {
  using namespace calipso::fem;
  const std::string usage =
      "usage: evaluate PATH...   (reference cases: JSON files, or folders of them)\n";
  calipso::helpIfAsked(argc, argv, usage);
  if (argc < 2) {
    std::cerr << usage;
    return 1;
  }
  bool complete = true;
  for (int k = 1; k < argc; ++k) {
    std::vector<std::string> files;
    complete &= attempt(argv[k], [&] { files = caseFiles(argv[k]); });
    for (const std::string& file : files) complete &= attempt(file, [&] { evaluateFile(file); });
  }
  return complete && failedAttempts() == 0 ? 0 : 1;
}
