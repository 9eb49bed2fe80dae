#include "frame/rest_recording.hpp"

namespace calipso::render {
namespace {

constexpr float kDark = 1e-5f;  // linear; a plate darker than that says nothing of its shadow

// CV_16SC1 over the region: surface that is seen, -1 = none
cv::Mat seenSurfaces(const StagedFrame& frame, const VisibilityBuffer& centre) {
  cv::Mat seen(centre.region().size(), CV_16S, cv::Scalar(-1));
  for (int v = 0; v < seen.rows; ++v) {
    for (int u = 0; u < seen.cols; ++u) {
      const std::uint32_t id = centre.ids(v)[u];
      if (id != VisibilityBuffer::kNothing)
        seen.at<short>(v, u) = static_cast<short>(frame.objectOf(id).surface);
    }
  }
  return seen;
}

Drawn drawnAt(const Row& row, int i) {
  const cv::Vec4f plain = row.at(i);
  if (isPlain(row.kinds[i])) return {{plain[0], plain[1], plain[2]}, 1.0f};
  return row.kinds[i] == kSpecial ? row.drawn[i] : Drawn();
}

}  // namespace

RestPicture recordAtRest(const StagedFrame& frame, const DrawnSurfaces& surfaces,
                         const RevealedPlace& revealed, const Reflections& reflections,
                         const Backdrop& backdrop, const RowComposer& composer,
                         const cv::Mat& removed) {
  const cv::Rect region = surfaces.centre().region();
  RestPicture picture(frame.edited, frame.input.bgr.size());
#pragma omp parallel
  {
    Row row;
#pragma omp for schedule(dynamic, 8)
    for (int j = 0; j < region.height; ++j) {
      const int v = j + region.y;
      composer.compose(v, row);
      for (int i = 0; i < region.width; ++i) {
        const int u = i + region.x;
        if (removed.at<std::uint8_t>(j, i) == 0) continue;
        const Drawn drawn = drawnAt(row, i);
        picture.passing.at<cv::Vec3f>(v, u) = {};
        picture.drawn.at<cv::Vec3f>(v, u) = drawn.cover * drawn.colour;
        if (drawn.cover == 1.0f) continue;
        const float beside = 1.0f - drawn.cover;
        picture.drawn.at<cv::Vec3f>(v, u) += beside * reflections.added(u, v);
        const cv::Vec3f behind = backdrop.unmirroredAt(u, v), place = revealed.at(u, v).colour;
        for (int c = 0; c < 3; ++c)
          picture.passing.at<cv::Vec3f>(v, u)[c] =
              beside * (place[c] > kDark ? behind[c] / place[c] : 1.0f);
      }
    }
  }
  picture.spreadOwners(seenSurfaces(frame, surfaces.centre()), removed, region);
  return picture;
}

}  // namespace calipso::render
