#pragma once

#include <vector>

#include "calipso_render/renderer.hpp"

namespace calipso::render {

// How camera and objects move in a clip, judged by pictures and masks alone.

bool cameraMoves(const ClipSample& clip);

// The frames with the models' outlines, where masks miss them of objects at rest (thin parts), and
// where something stands before them.
// @param frames as they were taken
// @param moves per surface
std::vector<ClipFrame> withOutlines(std::vector<ClipFrame> frames,
                                    const std::vector<Surface>& surfaces,
                                    const std::vector<bool>& moves);

// The frames as the key frame's camera would see them; labels 255 where they do not show it.
// @param frames as they were taken
// @param nearness of the place, from the key frame's camera
// @param margin px around masks that belong to the objects, as for placeNearness()
std::vector<ClipFrame> inKeyView(std::vector<ClipFrame> frames, const cv::Mat& nearness,
                                 int margin);

// What others hide of an object in a frame says nothing. A moving camera sees one at rest where its
// model at rest is, as well as they agree at the key frame, or where the poses say that it rests:
// masks of a lattice fill its gaps.
// @param frames as they were taken
bool movesInVideo(const std::vector<ClipFrame>& frames, const Surface& surface);

// What keeps its outline may yet bend within: then the picture of it changes.
bool swaysInVideo(const std::vector<ClipFrame>& frames, int index);

}  // namespace calipso::render
