#pragma once

namespace calipso::topics {

// Relative names; launch files put them into a namespace. docs/ARCHITECTURE.md says who talks to
// whom.
constexpr char kClipInfo[] = "clip/info";
constexpr char kClipImage[] = "clip/image";
constexpr char kClipCameraInfo[] = "clip/camera_info";
constexpr char kClipDynamics[] = "clip/dynamics";
constexpr char kImage[] = "image";
constexpr char kCameraInfo[] = "camera_info";
constexpr char kStrokes[] = "strokes";
constexpr char kSegmentation[] = "segmentation";
constexpr char kOverlay[] = "overlay";
constexpr char kModels[] = "models";
constexpr char kFlow[] = "flow";
constexpr char kDynamics[] = "dynamics";
constexpr char kEdits[] = "edits";
constexpr char kEditsApplied[] = "edits/applied";
constexpr char kPlan[] = "plan";
constexpr char kState[] = "state";
constexpr char kMarkers[] = "markers";
constexpr char kPlate[] = "plate";
constexpr char kImageEdited[] = "image_edited";
constexpr char kImageEditedCameraInfo[] = "image_edited/camera_info";
constexpr char kProvenance[] = "provenance";
constexpr char kStatus[] = "status";
constexpr char kTiming[] = "timing";
constexpr char kDiagnostics[] = "/diagnostics";

constexpr char kWorldFrame[] = "map";

}  // namespace calipso::topics
