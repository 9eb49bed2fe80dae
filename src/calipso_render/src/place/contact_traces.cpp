#include "place/contact_traces.hpp"

#include "light/shadow_check.hpp"
#include "place/key_cover.hpp"
#include "place/place_relief.hpp"
#include "place/relief_sky.hpp"

namespace calipso::render {

cv::Mat contactTraces(const std::vector<Actor>& actors, const cv::Mat& picture,
                      const RenderParams& params, Prepared& p) {
  const ReliefSky on_walls(p.relief, occludersOf(actors), ReliefSky::kFine);
  const cv::Mat sky = on_walls.visibility(picture.size()), objects = p.key_labels != 0,
                predicted = isShaded(cv::Mat::ones(sky.size(), CV_32F), sky) & ~objects;
  cv::Mat traces = cv::Mat::zeros(sky.size(), CV_8U);
  for (int k = 1; k <= static_cast<int>(p.relief.walls.size()); ++k) {
    const cv::Mat wall = (p.relief.wall == k) & p.relief.seen;
    if (cv::countNonZero(predicted & wall) == 0) continue;
    cv::Mat here = sky.clone();
    here.setTo(1.0f, ~wall);
    const cv::Mat dark = surelyDarker(here, picture, objects | ~wall);
    if (cv::countNonZero(dark) == 0) p.relief.wall.setTo(0, wall);
    traces |= grown(dark, params.background.shadow_margin_px) & wall;
  }
  p.relief.index();
  p.shadowless.setTo(
      0, traces | (turnedAway(p.relief, p.light.light.direction) & (p.relief.wall > 0)));
  return traces;
}

}  // namespace calipso::render
