#pragma once

#include <calipso_msgs/AlignedModel.h>
#include <visualization_msgs/Marker.h>

#include "calipso_align/alignment.hpp"
#include "calipso_scene/scene.hpp"

namespace calipso::align {

calipso_msgs::AlignedModel toMsg(const SceneObject& object, const AlignmentResult& result);

// The deformed mesh as triangles in the world, coloured by the object's index; red when not
// trusted.
visualization_msgs::Marker toMarker(const std_msgs::Header& header,
                                    const calipso_msgs::AlignedModel& model);

}  // namespace calipso::align
