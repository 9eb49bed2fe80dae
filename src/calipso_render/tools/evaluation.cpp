#include "evaluation.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "blind_sheet.hpp"
#include "calipso_render/inpaint.hpp"
#include "measures.hpp"
#include "picture_file.hpp"
#include "truth.hpp"
#include "turntable.hpp"

namespace calipso::render {
namespace {

constexpr int kSeam = 3;         // px on either side of the silhouette
constexpr int kRim = 3;          // px of a mask's rim that "inside" leaves out
constexpr int kAroundPart = 16;  // of the picture's width, around a moved object: its shadow
// frames of a moving object that are drawn again: odd ones, which a clip sample of more than 24
// frames leaves out
constexpr int kMovedFirst = 3, kMovedStep = 4;
constexpr double kTurned = 10.0 * M_PI / 180.0;  // rad from the key frame: copying is wrong
constexpr int kFlickerFrames = 8;
constexpr int kSummaryWidth = 1440;  // px
constexpr int kSheetFrames = 4;      // of a clip on a blind sheet
constexpr double kFlickers = 0.3;    // code values of true change from which flicker is judged

// Of what is edited.
cv::Mat maskOf(const FrameInput& in, const std::vector<Surface>& surfaces) {
  cv::Mat mask = cv::Mat::zeros(in.labels.size(), CV_8U);
  for (std::size_t i = 0; i < in.objects.size(); ++i) {
    if (in.objects[i].edited) mask |= in.labels == surfaces[i].index;
  }
  return mask;
}

class Evaluation {
 public:
  Evaluation(const std::string& directory, const EvaluationOptions& options)
      : scene_(enlarged(loadScene(directory), options.enlarge)),
        truth_(loadTruth(scene_)),
        options_(options) {
    params_.planes = scene_.planes;
    params_.up = -scene_.gravity.normalized();
    params_.depth = loadDepth(scene_);
    figures_.name = scene_.name;
  }

  Figures run() {
    prepareClip();
    if (!options_.appearance_only) judgeBackground();
    judgeAppearance();
    judgeUndeformed();
    judgeMoved();
    if (!options_.sheets.empty()) writeSheet();
    if (!options_.appearance_only) timeFrames();
    if (!options_.summaries.empty() && !summary_.empty()) writeSummary();
    return figures_;
  }

 private:
  void put(const std::string& key, std::optional<double> value) {
    figures_.values.emplace_back(key, value);
  }

  void picture(const std::string& what, const cv::Mat& image) const {
    if (options_.pictures.empty()) return;
    writePicture(options_.pictures + "/" + scene_.name + "_" + what + ".png", image);
  }

  void prepareClip() {
    ClipSample clip;
    for (int k = 0; k < scene_.frame_count; ++k)
      clip.add({loadFrame(scene_, k), loadLabels(scene_, k), scene_.cameraAt(k), posesAt(k),
                stampOf(k)});
    std::vector<ObjectModel> models;
    for (const Truth::Object& o : truth_.objects) models.push_back(o.model);
    const auto start = std::chrono::steady_clock::now();
    prepared_ = std::make_shared<Prepared>(prepare(clip, models, params_));
    ms_prepare_ = elapsedMs(start);
  }

  std::int64_t stampOf(int k) const { return static_cast<std::int64_t>(1e9 * k / scene_.fps); }

  std::vector<ObjectPose> posesAt(int k) const {
    std::vector<ObjectPose> poses;
    for (const Truth::Object& o : truth_.objects) {
      if (o.poses.size() > 1) poses.push_back({o.model.index, o.poses[k]});
    }
    return poses;
  }

  // Frame k with every object in the state that `change` gives it.
  template <typename Change>
  FrameInput frame(int k, Change change) const {
    FrameInput in{
        loadFrame(scene_, k), loadLabels(scene_, k), scene_.cameraAt(k), stampOf(k), {}, {}};
    for (std::size_t i = 0; i < prepared_->surfaces.size(); ++i) {
      ObjectInFrame o;
      o.name = prepared_->surfaces[i].name;
      o.vertices = prepared_->surfaces[i].key_vertices;
      const std::vector<Eigen::Isometry3d>& poses = truth_.objects[i].poses;
      if (poses.size() > 1) o.observed = poses[k];
      change(i, o);
      in.objects.push_back(o);
    }
    return in;
  }

  FrameInput removedFrame(int k) const {
    return frame(k, [](std::size_t, ObjectInFrame& o) { o.removed = true; });
  }

  RenderParams without(bool noise, bool still) const {
    RenderParams p = params_;
    p.add_noise = noise, p.keep_still = still;
    return p;
  }

  void judgeBackground() {
    cv::Mat plate;
    prepared_->background.plate.convertTo(plate, CV_8U);
    picture("plate", plate);
    const cv::Mat invented = prepared_->background.invented;
    picture("invented", invented);
    const auto truth = loadPlate(scene_, 0);
    const cv::Mat hidden = loadLabels(scene_, 0) != 0;
    const cv::Mat seen = hidden & (invented == 0);
    const cv::Mat emptied =
        Renderer(prepared_, without(false, true)).composite(removedFrame(0)).bgr;
    picture("removed", emptied);
    summary_ = {loadFrame(scene_, 0), Renderer(prepared_, params_).composite(removedFrame(0)).bgr};
    put("plate_psnr_seen_db", truth ? psnr(plate, *truth, seen) : std::nullopt);
    put("plate_psnr_invented_db", truth ? psnr(emptied, *truth, invented) : std::nullopt);
    put("gradient_ratio", truth ? gradientRatio(emptied, *truth, hidden & invented) : std::nullopt);
    put("flicker_ratio", flickerRatio());
  }

  std::optional<double> flickerRatio() const {
    Renderer renderer(prepared_, without(false, true));
    double own = 0.0, reference = 0.0;
    cv::Mat before, truth_before;
    for (int k = 0; k < std::min(kFlickerFrames, scene_.frame_count); ++k) {
      const auto truth = loadPlate(scene_, k);
      if (!truth) return std::nullopt;
      const cv::Mat now = renderer.composite(removedFrame(k)).bgr,
                    hidden = shrink(loadLabels(scene_, k) != 0, kRim);
      if (!before.empty())
        own += change(before, now, hidden).value_or(0.0),
            reference += change(truth_before, *truth, hidden).value_or(0.0);
      before = now, truth_before = *truth;
    }
    return reference > kFlickers ? std::optional<double>(own / reference) : std::nullopt;
  }

  void judgeAppearance() {
    const Eigen::Vector3d found = prepared_->light.light.direction.cast<double>();
    const auto angleTo = [&](const Eigen::Vector3d& sun) {
      return std::acos(std::clamp(found.dot(sun.normalized()), -1.0, 1.0)) * 180.0 / M_PI;
    };
    put("light_error_deg", truth_.to_sun ? std::optional(angleTo(*truth_.to_sun)) : std::nullopt);
    put("light_confirmed", prepared_->light.confirmed() ? 1.0 : 0.0);
    put("albedo_error_percent", albedoFigure());
    judgeRoughness();
    put("second_order_ambient", prepared_->light.second_order ? 1.0 : 0.0);
  }

  // Of the first object with a true one. The slope m is the square of the roughness that Principled
  // shaders ask for.
  void judgeRoughness() {
    const auto isTold = [](const Gloss& gloss, const Truth::Object& object) {
      return object.roughness && gloss.specular > 0.0f;
    };
    std::size_t i = 0;
    while (i < truth_.objects.size() && !isTold(prepared_->appearances[i].gloss, truth_.objects[i]))
      ++i;
    std::optional<double> error, range, inside;
    if (i < truth_.objects.size()) {
      const double truth = *truth_.objects[i].roughness;
      error = 100.0 * std::abs(std::sqrt(prepared_->appearances[i].gloss.roughness) / truth - 1.0);
      if (const auto told = prepared_->light.toldGloss(i)) {
        const double low = std::sqrt(told->smoothest), high = std::sqrt(told->roughest);
        range = high / low, inside = truth >= low && truth <= high ? 1.0 : 0.0;
      }
    }
    put("roughness_error_percent", error);
    put("roughness_observed", range ? 1.0 : 0.0);
    put("roughness_range", range);
    put("roughness_in_range", inside);
  }

  std::optional<double> albedoFigure() const {
    const auto truth = loadAlbedo(scene_);
    if (!truth) return std::nullopt;
    cv::Mat albedo = cv::Mat::zeros(truth->size(), CV_32FC3),
            known = cv::Mat::zeros(truth->size(), CV_8U);
    for (std::size_t i = 0; i < prepared_->surfaces.size(); ++i) {
      const Appearance& a = prepared_->appearances[i];
      const cv::Mat mask =
          shrink(prepared_->key_labels == prepared_->surfaces[i].index, kRim)(a.region);
      cv::Mat colour;
      cv::cvtColor(a.albedo, colour, cv::COLOR_BGRA2BGR);
      colour.copyTo(albedo(a.region), mask);
      known(a.region).setTo(255, mask);
    }
    return albedoError(albedo, *truth, known);
  }

  void judgeUndeformed() {
    const auto everything = [](std::size_t, ObjectInFrame& o) { o.edited = true; };
    const FrameInput in = frame(0, everything);
    const cv::Mat mask = in.labels != 0, inside = shrink(mask, kRim), seam = rim(mask, kSeam);
    const cv::Mat kept = Renderer(prepared_, params_).composite(in).bgr;
    const cv::Mat drawn = Renderer(prepared_, without(false, false)).composite(in).bgr;
    picture("undeformed", drawn);
    put("undeformed_psnr_db", psnr(kept, in.bgr, inside));
    put("seam_psnr_db", psnr(kept, in.bgr, seam));
    put("undeformed_drawn_psnr_db", psnr(drawn, in.bgr, inside));
    put("seam_drawn_psnr_db", psnr(drawn, in.bgr, seam));
    RenderParams plain = without(false, false);
    plain.carry_residual = false;
    put("undeformed_plain_psnr_db",
        psnr(Renderer(prepared_, plain).composite(in).bgr, in.bgr, inside));
  }

  // Crops of the video and of the same frames with everything edited but moving and deforming as it
  // does, all of it drawn, with noise.
  void writeSheet() const {
    Renderer renderer(prepared_, without(true, false));
    BlindSheet sheet(scene_.name);
    for (int k = 0; k < scene_.frame_count; k += std::max(1, scene_.frame_count / kSheetFrames)) {
      const FrameInput in = frame(k, [&](std::size_t i, ObjectInFrame& o) {
        o.edited = true;
        const auto& [model, poses, shapes, roughness] = truth_.objects[i];
        if (!shapes.empty())
          o.vertices = shapes[k];
        else if (poses.size() > 1)
          o.vertices = transformed(prepared_->surfaces[i].object_vertices, poses[k]);
      });
      const cv::Mat drawn = renderer.composite(in).bgr;
      for (const Truth::Object& o : truth_.objects)
        sheet.add(in.bgr, drawn, cv::boundingRect(in.labels == o.model.index), k);
    }
    sheet.write(options_.sheets);
  }

  // Appearances from the key frame alone, under p's light.
  std::vector<Appearance> keyAppearances(const Prepared& p) const {
    std::vector<View> views(1);
    loadFrame(scene_, 0).convertTo(views[0].picture, CV_32F);
    views[0].labels = p.key_labels, views[0].camera = scene_.camera;
    for (const Surface& s : p.surfaces)
      views[0].actors.push_back(makeActor(s, s.key_vertices, scene_.camera));
    std::vector<Gloss> glosses;
    for (const Appearance& a : p.appearances) glosses.push_back(a.gloss);
    return makeAppearances(views, p.moves, p.light.light, glosses, params_.planes, p.unseen_shade);
  }

  std::shared_ptr<Prepared> fromKeyFrame() const {
    auto key = std::make_shared<Prepared>(*prepared_);
    key->appearances = keyAppearances(*key);
    return key;
  }

  // The same texture without light: what copying pixels would give.
  std::shared_ptr<Prepared> unlit() const {
    auto flat = std::make_shared<Prepared>(*prepared_);
    flat->light.light.sun = {0, 0, 0};
    for (Appearance& a : flat->appearances) a.gloss = {};
    flat->light.light.ambient = {cv::Vec3f(1, 1, 1)};
    for (Surface& s : flat->surfaces) {
      std::fill(s.seen.begin(), s.seen.end(), SkySeen());
      std::fill(s.seen_behind.begin(), s.seen_behind.end(), SkySeen());
    }
    flat->appearances = keyAppearances(*flat);
    return flat;
  }

  // rad: the least turn of an object that moves, from the key frame to frame k.
  double turnedBy(int k) const {
    std::optional<double> least;
    for (const Truth::Object& o : truth_.objects) {
      if (o.poses.size() > 1)
        keepLowest(
            least,
            Eigen::AngleAxisd(o.poses[0].linear().transpose() * o.poses[k].linear()).angle());
    }
    return least.value_or(0.0);
  }

  void judgeMoved() {
    std::optional<double> moved, around, seam, copied, gain, turned_gain, from_clip, clip_seam;
    const RenderParams bare = without(false, false);
    Renderer renderer(fromKeyFrame(), bare), clip_renderer(prepared_, bare), copier(unlit(), bare);
    for (int k = kMovedFirst; k < scene_.frame_count; k += kMovedStep) {
      const auto followTruth = [&](std::size_t i, ObjectInFrame& o) {
        const auto& poses = truth_.objects[i].poses;
        o.edited = poses.size() > 1;
        if (o.edited) o.vertices = transformed(prepared_->surfaces[i].object_vertices, poses[k]);
      };
      const FrameInput in = frame(k, followTruth);
      if (std::none_of(in.objects.begin(), in.objects.end(),
                       [](const ObjectInFrame& o) { return o.edited; }))
        break;
      const cv::Mat drawn = renderer.composite(in).bgr, mask = maskOf(in, prepared_->surfaces),
                    inside = shrink(mask, 2);
      const auto relit = psnr(drawn, in.bgr, inside),
                 copy = psnr(copier.composite(in).bgr, in.bgr, inside);
      keepLowest(moved, relit), keepLowest(copied, copy);
      if (relit && copy) keepLowest(gain, *relit - *copy);
      if (relit && copy && turnedBy(k) >= kTurned) keepLowest(turned_gain, *relit - *copy);
      const cv::Mat with_clip = clip_renderer.composite(in).bgr;
      keepLowest(from_clip, psnr(with_clip, in.bgr, inside));
      keepLowest(seam, psnr(drawn, in.bgr, rim(mask, kSeam)));
      keepLowest(clip_seam, psnr(with_clip, in.bgr, rim(mask, kSeam)));
      picture("clip_moved_" + std::to_string(k), with_clip);
      keepLowest(around, psnr(drawn, in.bgr, grow(mask, mask.cols / kAroundPart) & ~grow(mask, 2)));
      picture("moved_" + std::to_string(k), drawn);
    }
    put("moved_psnr_db", moved);
    put("shadow_psnr_db", around);
    put("moved_seam_psnr_db", seam);
    put("moved_from_clip_psnr_db", from_clip);
    put("moved_seam_from_clip_psnr_db", clip_seam);
    put("moved_copied_psnr_db", copied);
    put("relighting_gain_db", gain);
    put("relighting_gain_turned_db", turned_gain);
  }

  // Every object lifted by a twentieth of the distance: drawn, shaded and replaced in full.
  double msPerFrame(Quality quality) {
    RenderParams p = params_;
    p.quality = quality;
    Renderer renderer(prepared_, p);
    const double distance = (prepared_->surfaces[0].key_vertices[0].cast<double>() -
                             scene_.camera.world_from_camera.translation())
                                .norm();
    const Eigen::Vector3f lift = (0.05 * distance * params_.up).cast<float>();
    const FrameInput in = frame(0, [&](std::size_t, ObjectInFrame& o) {
      o.edited = true;
      for (Eigen::Vector3f& x : o.vertices) x += lift;
    });
    double best = 1e9;
    for (int i = 0; i < 5; ++i) {
      const auto start = std::chrono::steady_clock::now();
      const FrameOutput out = renderer.composite(in);
      best = std::min(best, elapsedMs(start));
      if (i == 0) picture(quality == Quality::kFinal ? "lifted_final" : "lifted", out.bgr);
      if (i == 0 && quality == Quality::kFinal) summary_.push_back(out.bgr);
    }
    return best;
  }

  void writeSummary() const {
    cv::Mat all;
    cv::hconcat(summary_, all);
    const double scale = static_cast<double>(kSummaryWidth) / all.cols;
    cv::resize(all, all, {}, scale, scale, cv::INTER_AREA);
    const std::vector<int> quality = {cv::IMWRITE_JPEG_QUALITY, 85};
    writePicture(options_.summaries + "/" + scene_.name + ".jpg", all, quality);
    const cv::Mat around = turntable(prepared_, params_, frame(0, [](auto, auto&) {}));
    if (!around.empty())
      writePicture(options_.summaries + "/" + scene_.name + "_around.jpg", around, quality);
  }

  void timeFrames() {
    put("ms_prepare", ms_prepare_);
    put("ms_prepare_background", prepared_->background_ms);
    put("ms_prepare_appearance", prepared_->appearance_ms);
    put("ms_inpaint", prepared_->background.filling_ms);
    put("ms_frame_live", msPerFrame(Quality::kLive));
    put("ms_frame_final", msPerFrame(Quality::kFinal));
  }

  Scene scene_;
  Truth truth_;
  EvaluationOptions options_;
  RenderParams params_;
  std::shared_ptr<Prepared> prepared_;
  double ms_prepare_ = 0.0;
  std::vector<cv::Mat> summary_;
  Figures figures_;
};

}  // namespace

Figures evaluateScene(const std::string& directory, const EvaluationOptions& options) {
  for (const std::string& folder : {options.pictures, options.summaries, options.sheets})
    makePictureFolder(folder);
  return Evaluation(directory, options).run();
}

}  // namespace calipso::render
