#include "frame/frame_compositor.hpp"

#include <algorithm>
#include <cstring>

#include "draw/side_by_side.hpp"
#include "frame/marked.hpp"
#include "frame/removed.hpp"
#include "frame/rest_recording.hpp"
#include "frame/soft_outlines.hpp"

namespace calipso::render {

FrameCompositor::FrameCompositor(const Prepared& prepared, const RenderParams& params,
                                 const FrameInput& input, FrameCaches& caches)
    : caches_(caches),
      frame_(prepared, params, input),
      place_(frame_),
      reflections_(frame_, place_),
      revealed_(frame_, place_, reflections_),
      moved_(frame_, place_),
      resting_(caches.light.update(frame_, place_)),
      others_(frame_, moved_, resting_),
      passing_(passingShadows(frame_, place_, reflections_.unmirrored(),
                              resting_.othersSunInVideo(), caches.plate)),
      region_(frame_, resting_, moved_, others_, reflections_, passing_),
      codec_(params.add_noise ? prepared.noise : NoiseModel(), input.stamp_ns) {}

FrameOutput FrameCompositor::run() {
  const cv::Mat& bgr = frame_.input.bgr;
  if (region_.all.empty()) return {bgr.clone(), cv::Mat::zeros(bgr.size(), CV_8U)};
  drawRegion();
  const RowComposer composer = this->composer();
  FrameOutput out{cv::Mat(bgr.size(), CV_8UC3), cv::Mat(bgr.size(), CV_8U)};
#pragma omp parallel
  {
    Row row;
#pragma omp for schedule(dynamic, 8)
    for (int v = 0; v < bgr.rows; ++v) {
      std::memcpy(out.bgr.ptr(v), bgr.ptr(v), 3 * static_cast<std::size_t>(bgr.cols));
      std::memset(out.provenance.ptr(v), kOriginal, bgr.cols);
      if (v >= region_.all.y && v < region_.all.br().y) composeRow(composer, v, row, out);
    }
  }
  softenOutlines(frame_, *surfaces_, out);
  return out;
}

void FrameCompositor::drawRegion() {
  removed_ = removedPixels(frame_, place_, region_, passing_, reflections_.marks(), caches_.shown);
  surfaces_.emplace(frame_, place_, region_, removed_);
  const bool carries = updateRest();
  sideBySide(
      frame_.params.quality == Quality::kLive,
      [this] { light_.emplace(frame_, place_, resting_, moved_, region_, surfaces_->covered()); },
      [this] { shader_.emplace(frame_, place_, *surfaces_, moved_, resting_); },
      [this] { edges_.emplace(surfaces_->sampleEdges()); },
      [this] { still_.emplace(frame_, place_, surfaces_->centre(), removed_); },
      [this, carries] {
        if (carries) residual_.emplace(frame_, revealed_, surfaces_->centre(), caches_.rest);
      },
      [this] { screen_.emplace(frame_, place_, surfaces_->centre()); });
  still_->leaveRelit(*light_, moved_, resting_, removed_);
  backdrop_.emplace(frame_, place_, revealed_, reflections_, others_, *surfaces_, *edges_, *light_,
                    removed_);
  kinds_.emplace(frame_, reflections_, others_, *surfaces_, *edges_, *light_, *still_, *screen_,
                 removed_);
  sheets_.emplace(*surfaces_, *edges_, *shader_, *screen_);
}

// Brings the picture of what rests in the video up to date, if anything of it is carried over.
bool FrameCompositor::updateRest() {
  if (!frame_.params.carry_residual || !frame_.at_key_camera) return false;
  const auto rests = [](const StagedObject& o) { return o.isAtRestInVideo(); };
  if (std::none_of(frame_.objects.begin(), frame_.objects.end(), rests)) return false;
  std::vector<bool> resting(frame_.edited.size());  // per surface: edited, and at rest in the video
  for (std::size_t i = 0; i < resting.size(); ++i)
    resting[i] = frame_.edited[i] && frame_.at_rest[i];
  if (caches_.rest.edited != resting) caches_.rest = pictureAtRest(resting);
  return true;
}

// Such objects drawn where the video has them, from what was prepared alone.
RestPicture FrameCompositor::pictureAtRest(const std::vector<bool>& edited) const {
  const FrameInput input = frameAtRest(frame_.prepared, edited);
  RenderParams plain = frame_.params;
  plain.add_noise = plain.keep_still = plain.carry_residual = false;
  FrameCaches none;
  FrameCompositor rest(frame_.prepared, plain, input, none);
  if (rest.region_.all.empty()) return RestPicture(edited, input.bgr.size());
  rest.drawRegion();
  return recordAtRest(rest.frame_, *rest.surfaces_, rest.revealed_, rest.reflections_,
                      *rest.backdrop_, rest.composer(), rest.removed_);
}

RowComposer FrameCompositor::composer() const {
  return RowComposer(frame_, *surfaces_, *kinds_, *sheets_, *shader_, *backdrop_, *screen_,
                     residual_ ? &*residual_ : nullptr);
}

void FrameCompositor::composeRow(const RowComposer& composer, int v, Row& row,
                                 FrameOutput& out) const {
  composer.compose(v, row);
  if (residual_) residual_->addRims(v, *still_, row);
  still_->keep(v, row);
  const int left = region_.all.x, width = region_.all.width;
  cv::Vec3b* codes = out.bgr.ptr<cv::Vec3b>(v) + left;
  const std::uint8_t* source = row.source.data();
  for (int i = nextMarked(source, 0, width); i < width; i = nextMarked(source, i, width)) {
    const int first = i;
    i = nextUnmarked(source, i, width, 0xff);
    codec_.encode({&row.colour[0][first], &row.colour[1][first], &row.colour[2][first],
                   &row.colour[3][first], &row.colour[4][first]},
                  left + first, v, i - first, codes + first);
  }
  std::memcpy(out.provenance.ptr<std::uint8_t>(v) + left, source, width);
}

}  // namespace calipso::render
