#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace calipso::bag {

enum class NodeState { kStarting, kPreparing, kReady, kFailed };

// What a node last said about itself; as in calipso_msgs/NodeStatus.
struct NodeStanding {
  NodeState state = NodeState::kStarting;
  std::string message;
  int clip_frames = 0;
  int edits = 0;
};

// Who has to be ready before what may be sent (bag mode's first pass). A node that FAILED is never
// waited for. Not thread-safe.
class Preparation {
 public:
  // Nodes that must settle before the second clip frame, those that count clip frames, and all.
  struct Roles {
    std::vector<std::string> key_frame = {"segmentation", "align"};
    std::vector<std::string> clip = {"segmentation", "flow", "render"};
    std::vector<std::string> all = {"segmentation", "align",  "flow",
                                    "simulator",    "render", "recorder"};
  };

  Preparation() : Preparation(Roles()) {}
  explicit Preparation(Roles roles) : roles_(std::move(roles)) {}

  // Takes in what a node says. A node once failed stays failed; strangers are ignored.
  void update(const std::string& node, const NodeStanding& standing);

  // Marks a node as failed on its behalf, e.g. because its process ended.
  void fail(const std::string& node, const std::string& reason);

  // Notes that a node's process has ended by then (ns, as all stamps).
  void end(const std::string& node, std::int64_t noticed) { ended_.emplace(node, noticed); }
  bool ended(const std::string& node) const { return ended_.count(node) > 0; }

  // True of what was said after the node's process had ended: another was started in its place. Its
  // own last words may arrive later than the news of its end.
  bool saidBySuccessor(const std::string& node, std::int64_t said) const;

  bool keyFrameSettled() const { return hopeless() || unsettled(roles_.key_frame).empty(); }
  bool allSettled() const { return hopeless() || unsettled(roles_.all).empty(); }

  // A node that every other one builds on has failed: there is nothing more to prepare.
  bool hopeless() const;
  std::vector<std::string> unsettled() const { return unsettled(roles_.all); }

  // Clip frames that every living node has taken in; `sent` when none is alive.
  int clipFramesTaken(int sent) const;

  // Edited frames that the recorder has taken in; `edited` when none takes part or it has failed.
  int framesRecorded(int edited) const;

  NodeStanding standing(const std::string& node) const;
  std::vector<std::string> failed() const;

 private:
  std::vector<std::string> unsettled(const std::vector<std::string>& nodes) const;

  Roles roles_;
  std::map<std::string, NodeStanding> standing_;
  std::map<std::string, std::int64_t> ended_;  // when it was noticed
};

}  // namespace calipso::bag
