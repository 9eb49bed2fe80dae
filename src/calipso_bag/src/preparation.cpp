#include "calipso_bag/preparation.hpp"

#include <algorithm>

namespace calipso::bag {

void Preparation::update(const std::string& node, const NodeStanding& standing) {
  if (std::find(roles_.all.begin(), roles_.all.end(), node) == roles_.all.end()) return;
  NodeStanding& known = standing_[node];
  if (known.state != NodeState::kFailed) known = standing;
}

void Preparation::fail(const std::string& node, const std::string& reason) {
  NodeStanding failed = standing(node);
  failed.state = NodeState::kFailed;
  failed.message = reason;
  update(node, failed);
}

bool Preparation::saidBySuccessor(const std::string& node, std::int64_t said) const {
  const auto end = ended_.find(node);
  return end != ended_.end() && said > end->second;
}

bool Preparation::hopeless() const {
  const auto& nodes = roles_.key_frame;
  return std::any_of(nodes.begin(), nodes.end(), [this](const std::string& node) {
    return standing(node).state == NodeState::kFailed;
  });
}

int Preparation::clipFramesTaken(int sent) const {
  int taken = sent;
  for (const std::string& node : roles_.clip) {
    const NodeStanding now = standing(node);
    if (now.state != NodeState::kFailed) taken = std::min(taken, now.clip_frames);
  }
  return taken;
}

int Preparation::framesRecorded(int edited) const {
  const auto recorder = standing_.find("recorder");
  if (recorder == standing_.end() || recorder->second.state == NodeState::kFailed) return edited;
  return recorder->second.clip_frames;
}

NodeStanding Preparation::standing(const std::string& node) const {
  const auto found = standing_.find(node);
  return found == standing_.end() ? NodeStanding() : found->second;
}

std::vector<std::string> Preparation::failed() const {
  std::vector<std::string> names;
  for (const std::string& node : roles_.all) {
    if (standing(node).state == NodeState::kFailed) names.push_back(node);
  }
  return names;
}

std::vector<std::string> Preparation::unsettled(const std::vector<std::string>& nodes) const {
  std::vector<std::string> names;
  for (const std::string& node : nodes) {
    const NodeState state = standing(node).state;
    if (state != NodeState::kReady && state != NodeState::kFailed) names.push_back(node);
  }
  return names;
}

}  // namespace calipso::bag
