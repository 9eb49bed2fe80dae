#include "run_log.hpp"

namespace calipso::bag {

void note(const calipso_msgs::Plan& plan, RunSummary& summary) {
  for (const calipso_msgs::ObjectPlan& object : plan.objects) {
    ObjectSummary& line = summary.objects[object.object];
    line.kind = object.kind;
    line.reason = object.reason;
    line.nodes = static_cast<int>(object.nodes);
    line.elements = static_cast<int>(object.elements);
    line.cell_size = object.cell_size;
    line.time_step = object.time_step;
    line.solver = object.solver;
  }
}

void note(const calipso_msgs::AlignedModels& models, RunSummary& summary) {
  for (const calipso_msgs::AlignedModel& model : models.models) {
    ObjectSummary& line = summary.objects[model.object];
    line.aligned = true;
    line.contour_mean_px = model.contour_mean_px;
    line.contour_p95_px = model.contour_p95_px;
    line.trusted = model.trusted;
    line.doubt = model.reason;
  }
}

void note(const calipso_msgs::EditReport& report, RunSummary& summary) {
  if (report.accepted) {
    ++summary.edits_accepted;
  } else {
    summary.edits_refused.push_back(report.edit.kind + " " + report.edit.object + ": " +
                                    report.message);
  }
}

void note(const calipso_msgs::Timing& timing, RunSummary& summary) {
  summary.ms_per_frame[timing.node].push_back(timing.ms);
}

void note(const calipso_msgs::NodeStatus& status, RunSummary& summary) {
  if (status.state == calipso_msgs::NodeStatus::FAILED) {
    summary.failed.emplace(status.node, status.message);
  }
}

}  // namespace calipso::bag
