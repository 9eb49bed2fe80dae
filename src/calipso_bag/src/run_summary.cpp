#include "calipso_bag/run_summary.hpp"

#include <algorithm>
#include <cassert>
#include <iomanip>
#include <sstream>

namespace calipso::bag {
namespace {

void formatModel(const ObjectSummary& object, std::ostream& out) {
  if (object.kind.empty()) {
    out << "no plan";
    return;
  }
  out << object.kind;
  if (object.cell_size > 0.0) {
    out << " (" << object.nodes << " nodes, " << object.elements << " elements of "
        << 1e3 * object.cell_size << " mm, step " << 1e3 * object.time_step << " ms, "
        << object.solver << ")";
  }
  if (!object.reason.empty()) out << ": " << object.reason;
}

void formatObject(const std::string& name, const ObjectSummary& object, std::ostream& out) {
  out << "\n  " << name << ": ";
  formatModel(object, out);
  out << "\n    alignment: ";
  if (!object.aligned) {
    out << "none";
    return;
  }
  out << "contour error " << object.contour_mean_px << " px (95 %: " << object.contour_p95_px
      << " px)";
  if (!object.trusted) out << "; not trusted: " << object.doubt;
}

void formatEdits(const RunSummary& summary, std::ostream& out) {
  out << "\nedits: " << summary.edits_accepted << " applied";
  if (!summary.edits_refused.empty()) out << ", " << summary.edits_refused.size() << " refused";
  for (const std::string& refusal : summary.edits_refused) out << "\n  refused: " << refusal;
}

void formatTimes(const RunSummary& summary, std::ostream& out) {
  out << "\ntime per frame (median, ms):";
  for (const auto& [node, ms] : summary.ms_per_frame) {
    if (!ms.empty()) out << "  " << node << " " << median(ms);
  }
  if (summary.edit_seconds > 0.0 && summary.frames_out > 1) {
    out << "\nediting ran at " << (summary.frames_out - 1) / summary.edit_seconds
        << " frames per second";
  }
}

}  // namespace

double median(std::vector<double> values) {
  assert(!values.empty());
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  if (values.size() % 2 == 1) return *middle;
  return 0.5 * (*middle + *std::max_element(values.begin(), middle));
}

std::string format(const RunSummary& summary) {
  std::ostringstream out;
  out << std::fixed << std::setprecision(2);
  out << "frames: " << summary.frames_in << " in, " << summary.frames_out << " out";
  formatEdits(summary, out);
  out << "\nobjects:";
  for (const auto& [name, object] : summary.objects) formatObject(name, object, out);
  formatTimes(summary, out);
  for (const auto& [node, why] : summary.failed) out << "\n" << node << " failed: " << why;
  out << "\noutput: " << summary.output;
  return out.str();
}

}  // namespace calipso::bag
