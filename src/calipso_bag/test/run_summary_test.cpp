#include "calipso_bag/run_summary.hpp"

#include <gtest/gtest.h>

using namespace calipso::bag;

namespace {

void expectSays(const std::string& text, const std::string& part) {
  EXPECT_NE(text.find(part), std::string::npos) << "'" << part << "' is not in:\n" << text;
}

}  // namespace

TEST(Median, OfOddAndEvenCounts) {
  EXPECT_DOUBLE_EQ(median({3.0, 1.0, 2.0}), 2.0);
  EXPECT_DOUBLE_EQ(median({4.0, 1.0, 3.0, 2.0}), 2.5);
}

TEST(RunSummary, SaysWhatTheRunDid) {
  RunSummary summary;
  summary.frames_in = summary.frames_out = 31;
  summary.edits_accepted = 2;
  summary.edits_refused = {"pull cup: no surface under pixel (3, 4)"};
  ObjectSummary& pear = summary.objects["pear"];
  pear.kind = "deformable";
  pear.reason = "an edit pulls it";
  pear.cell_size = 0.008;
  pear.time_step = 0.0167;
  pear.nodes = 120;
  pear.elements = 60;
  pear.solver = "CHOLMOD";
  pear.aligned = true;
  pear.contour_mean_px = 0.7;
  summary.ms_per_frame["render"] = {9.0, 11.0};
  summary.edit_seconds = 2.0;
  summary.output = "out.bag";
  const std::string text = format(summary);
  expectSays(text, "frames: 31 in, 31 out");
  expectSays(text, "2 applied, 1 refused");
  expectSays(text, "no surface under pixel (3, 4)");
  expectSays(text, "pear: deformable (120 nodes, 60 elements of 8.00 mm");
  expectSays(text, "an edit pulls it");
  expectSays(text, "contour error 0.70 px");
  expectSays(text, "render 10.00");
  expectSays(text, "15.00 frames per second");
  expectSays(text, "output: out.bag");
}

TEST(RunSummary, SaysWhichNodeFailedAndWhichFitIsDoubted) {
  RunSummary summary;
  summary.failed["flow"] = "its process ended";
  summary.objects["pear"].aligned = true;
  summary.objects["pear"].trusted = false;
  summary.objects["pear"].doubt = "half of the contour is hidden";
  const std::string text = format(summary);
  expectSays(text, "flow failed: its process ended");
  expectSays(text, "not trusted: half of the contour is hidden");
}
