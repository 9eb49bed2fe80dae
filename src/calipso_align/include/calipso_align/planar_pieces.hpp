#pragma once

#include <opencv2/core.hpp>

namespace calipso::align {

struct Relief;

// Connected parts of a relief that are one plane: no jump, no crease, and flat as a whole. An
// object does not end in the middle of one as a rule, whatever its colours do there. Returns
// CV_32S: the piece's number from 1, 0 where a pixel is in none.
// crease: creaseThreshold()
cv::Mat planarPieces(const Relief& relief, float crease);

// The pieces that lie in one plane with others, such as the tiles of a wall between their joints:
// CV_32S, per pixel the number of its plane from 1, 0 where a pixel is in no piece or in a small one.
cv::Mat sharedPlanes(const Relief& relief, const cv::Mat& pieces);

// How far the inverse depth of a relief may bend at a pixel without a crease, in its units.
float creaseThreshold(const Relief& relief);

// Per pixel the value of the strokes that its piece bears, 0 where it bears none or different ones.
// strokes  CV_8U, 0: none
cv::Mat strokesOfPieces(const cv::Mat& pieces, const cv::Mat& strokes);

}  // namespace calipso::align
