#pragma once

#include "fill/line_ends.hpp"

namespace calipso::render {

constexpr float kLineStray = 1.5f;  // px by which pieces of one line may miss each other

// How two ends go together that look at each other from either side of a hole.

// px by which the line of either misses the other, and by which they may when they are `gap` px apart
float strayOf(const LineEnd& a, const LineEnd& b);
float allowedStray(float gap);
bool areInLine(const LineEnd& a, const LineEnd& b, float gap);

// Is what lies beside them alike, side by side?
bool besideAlike(const LineEnd& a, const LineEnd& b);
// On one side. @param side of a, as LineEnd::beside; of b it is the other one
bool besideAlike(const LineEnd& a, const LineEnd& b, int side);
bool standOut(const LineEnd& a, const LineEnd& b, int side);

// Difference of the colours across them, to their contrast: of lines and what is beside them,
float differenceAcross(const LineEnd& a, const LineEnd& b);
// ... of the lines themselves, wherever in a pixel they lie,
float differenceAlone(const LineEnd& a, const LineEnd& b);
// ... and of the line and what is on one side of it. @param side as besideAlike()'s
float differenceOfSide(const LineEnd& a, const LineEnd& b, int side);

}  // namespace calipso::render
