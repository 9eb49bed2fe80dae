#pragma once

#include <calipso_msgs/AlignedModels.h>
#include <calipso_msgs/EditReport.h>
#include <calipso_msgs/NodeStatus.h>
#include <calipso_msgs/Plan.h>
#include <calipso_msgs/Timing.h>

#include "calipso_bag/run_summary.hpp"

namespace calipso::bag {

// Each takes what a message says into the summary of a run.
void note(const calipso_msgs::Plan& plan, RunSummary& summary);
void note(const calipso_msgs::AlignedModels& models, RunSummary& summary);
void note(const calipso_msgs::EditReport& report, RunSummary& summary);
void note(const calipso_msgs::Timing& timing, RunSummary& summary);
void note(const calipso_msgs::NodeStatus& status, RunSummary& summary);

}  // namespace calipso::bag
