#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "calipso_render/clip_sample.hpp"
#include "calipso_render/stage.hpp"

namespace calipso::render {

// Where the objects were, by the frame's stamp, as somebody else estimated it.
using PosesByStamp = std::map<std::int64_t, std::vector<ObjectPose>>;

// Does any of the objects move in the clip? Only then do further frames show more of them than the
// key frame.
bool anyMoves(const ClipSample& clip, const std::vector<ObjectModel>& models);

// What became of them.
struct PosesTaken {
  int offered = 0, accepted = 0;
  double worst_accepted_overlap = 1.0;
};

// Gives the clip's frames the poses that fit their pictures: the model drawn there has to overlap
// its mask by `least` (intersection over union), where no other object's mask stands before it. If
// it is said to rest throughout, by part of what it does at the key frame: of a lattice masks miss
// members and fill gaps.
PosesTaken takePoses(const PosesByStamp& poses, const std::vector<ObjectModel>& models,
                     ClipSample& clip, double least = 0.9);

}  // namespace calipso::render
