#pragma once

#include <map>
#include <string>
#include <vector>

namespace calipso::bag {

// How one object was fitted and is modelled.
struct ObjectSummary {
  std::string kind;  // static, kinematic, rigid, deformable; empty: the simulator said nothing
  std::string reason;
  int nodes = 0;
  int elements = 0;
  double cell_size = 0.0;  // m; 0: no volume
  double time_step = 0.0;  // s
  std::string solver;
  bool aligned = false;
  double contour_mean_px = 0.0;
  double contour_p95_px = 0.0;
  bool trusted = true;
  std::string doubt;  // why the fit is not trusted
};

// What a run did, for the person who started it.
struct RunSummary {
  int frames_in = 0;
  int frames_out = 0;
  int edits_accepted = 0;
  std::vector<std::string> edits_refused;                   // one message each
  std::map<std::string, ObjectSummary> objects;             // by name
  std::map<std::string, std::vector<double>> ms_per_frame;  // by node
  std::map<std::string, std::string> failed;                // node -> why
  double edit_seconds = 0.0;                                // first edited frame to last, wall time
  std::string output;                                       // path of the bag
};

// @pre !values.empty()
double median(std::vector<double> values);

// Lines of text, without a trailing newline.
std::string format(const RunSummary& summary);

}  // namespace calipso::bag
