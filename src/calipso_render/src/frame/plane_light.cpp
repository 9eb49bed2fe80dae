#include "frame/plane_light.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "calipso_render/sky_map.hpp"
#include "draw/eight_lanes.hpp"
#include "draw/light_batch.hpp"
#include "draw/wide_loops.hpp"
#include "frame/marked.hpp"

namespace calipso::render {
namespace {

constexpr int kLargest = 64, kSquare = SquareMask::kSide,
              kStep = 2;          // px: squares, and the places in the least of them
constexpr float kCorner = -0.5f;  // px from a pixel to its first corner
// of visibility: places that differ by no more speak for those between them
constexpr float kEven = 0.05f;
// of visibility: between places that differ by no more it is interpolated
constexpr float kSlow = 0.3f;
// times as far off a pixel's plane as the nearest pixel beside it is away: another surface
constexpr float kEnds = 2.0f;
constexpr float kUnseen = -1.0f;  // visibility of a light where nothing takes its shadows

class Squares {
 public:
  Squares(const PlaceView& view, const Visibility& light, const cv::Rect& rect,
          const SquareMask& skip, cv::Mat& out, SquareMask* shaded)
      : view_(view), light_(light), rect_(rect), skip_(skip), out_(out), shaded_(shaded) {}

  // Squares hang on the picture, not on the rectangle: pixels are the same whatever else is asked
  // for.
  void run() const {
    const int first_row = rect_.y / kLargest, rows = (rect_.br().y - 1) / kLargest - first_row + 1;
#pragma omp parallel for schedule(dynamic, 1)
    for (int j = 0; j < rows; ++j) {
      for (int u = rect_.x / kLargest * kLargest; u < rect_.br().x; u += kLargest)
        fill({u, (first_row + j) * kLargest, kLargest, kLargest});
    }
  }

 private:
  void fill(const cv::Rect& square) const {
    const cv::Rect here = (square & rect_) - rect_.tl();
    if (here.empty() || skip_.all(square & rect_)) return;
    const bool off_planes = view_.relief().touches(square.x, square.y, square.width);
    const std::optional<Disc> disc = off_planes ? wallDisc(square) : planeDisc(square);
    const std::optional<float> uniform =
        disc ? light_.uniform(disc->middle.position, disc->middle.normal, disc->radius)
             : std::nullopt;
    const bool split = !uniform && square.width > kSquare;
    if (shaded_ != nullptr && !split && uniform != 1.0f) shaded_->set(here + rect_.tl());
    if (uniform) {
      for (int y = here.y; y < here.br().y; ++y)
        std::memset(out_.ptr<std::uint8_t>(y) + here.x, lightLevel(*uniform), here.width);
    } else if (split) {
      const int half = square.width / 2;
      for (int k = 0; k < 4; ++k)
        fill({square.x + (k & 1) * half, square.y + (k >> 1) * half, half, half});
    } else if (disc && !off_planes) {
      refine(square, here);
    } else {
      fillExactly(square, here);
    }
  }

  // What a square sees, if it is plane.
  struct Disc {
    Receiver middle;
    float radius;  // m, to its farthest corner
  };

  template <typename At>
  static std::optional<Disc> discOf(const cv::Rect& square, const Receiver& middle, At at) {
    Disc disc{middle, 0.0f};
    for (int k = 0; k < 4; ++k) {
      Receiver corner = middle;
      if (!at(square.x + kCorner + (k & 1) * square.width,
              square.y + kCorner + (k >> 1) * square.height, corner) ||
          corner.normal != middle.normal)
        return std::nullopt;
      disc.radius = std::max(disc.radius, (corner.position - middle.position).norm());
    }
    return disc;
  }

  std::optional<Disc> planeDisc(const cv::Rect& square) const {
    Receiver middle;
    if (!view_.at(square.x + kCorner + 0.5f * square.width,
                  square.y + kCorner + 0.5f * square.height, middle))
      return std::nullopt;
    return discOf(square, middle,
                  [this](float u, float v, Receiver& r) { return view_.at(u, v, r); });
  }

  std::optional<Disc> wallDisc(const cv::Rect& square) const {
    if (!view_.relief().isOneWall(square)) return std::nullopt;
    return discOf(
        square, view_.relief().receiver(square.x + square.width / 2, square.y + square.height / 2),
        [this](float u, float v, Receiver& r) { return view_.slide(u, v, r); });
  }

  // Places looked up at once.
  class Lookup {
   public:
    explicit Lookup(const Squares& squares) : squares_(squares) {}
    // @param otherwise what is kept where neither plane nor relief is seen
    void add(float u, float v, float* visible, float otherwise = 1.0f) {
      Receiver r;
      *visible = otherwise;
      if (squares_.view_.at(u, v, r)) add(r, visible);
    }
    // What pixel (u, v) sees so far beside its centre.
    void addBeside(int u, int v, float du, float dv, float* visible) {
      Receiver r;
      *visible = 1.0f;
      if (squares_.view_.beside(u, v, du, dv, r)) add(r, visible);
    }
    void look() {
      float visible[LightBatch::kMost];
      batch_.look(squares_.light_, visible);
      for (int k = 0; k < batch_.count(); ++k) *out_[k] = visible[k];
      batch_.clear();
    }

   private:
    void add(const Receiver& r, float* visible) {
      out_[batch_.add(r.position, r.normal)] = visible;
      if (batch_.count() == LightBatch::kMost) look();
    }

    const Squares& squares_;
    LightBatch batch_;
    float* out_[LightBatch::kMost];
  };

  // Corners of the square's pixels: each pixel has what its four see on average, as soft as
  // lenses and its width make its picture.
  static constexpr int kCorners = kSquare + 1, kPlaces = kSquare / kStep + 1;

  // Places two steps apart are looked at first; those between where they, or the one in their
  // middle, differ.
  void fillGrid(const cv::Rect& square, float (&grid)[kPlaces][kPlaces]) const {
    Lookup lookup(*this);
    const auto set = [&](int i, int j) {
      lookup.add(square.x + kCorner + i * kStep, square.y + kCorner + j * kStep, &grid[j][i]);
    };
    for (int j = 0; j < kPlaces; ++j) {
      for (int i = j % 2; i < kPlaces; i += 2) set(i, j);
    }
    lookup.look();
    bool uneven[kPlaces / 2][kPlaces / 2] = {};
    for (int j = 1; j < kPlaces; j += 2) {
      for (int i = 1; i < kPlaces; i += 2) {
        const auto [low, high] = std::minmax({grid[j][i], grid[j - 1][i - 1], grid[j - 1][i + 1],
                                              grid[j + 1][i - 1], grid[j + 1][i + 1]});
        uneven[j / 2][i / 2] = high - low > kEven;
      }
    }
    const auto isUneven = [&](int i, int j) {
      return i >= 0 && j >= 0 && i < kPlaces / 2 && j < kPlaces / 2 && uneven[j][i];
    };
    for (int j = 0; j < kPlaces; ++j) {
      for (int i = 1 - j % 2; i < kPlaces; i += 2) {
        const bool level = j % 2 == 0;  // it lies between a left and a right one
        if (isUneven(i / 2, j / 2) ||
            (level ? isUneven(i / 2, j / 2 - 1) : isUneven(i / 2 - 1, j / 2)))
          set(i, j);
        else
          grid[j][i] = level ? 0.5f * (grid[j][i - 1] + grid[j][i + 1])
                             : 0.5f * (grid[j - 1][i] + grid[j + 1][i]);
      }
    }
    lookup.look();
  }

  // The pixels of a square by its grid; exactly where its places differ by much.
  void refine(const cv::Rect& square, const cv::Rect& here) const {
    float grid[kPlaces][kPlaces], corners[kCorners][kCorners], visible[kSquare][kSquare];
    fillGrid(square, grid);
    interpolate(grid, corners);
    bool wanted[kCorners][kCorners] = {};
    for (int j = 0; j + 1 < kPlaces; ++j) {
      for (int i = 0; i + 1 < kPlaces; ++i) {
        const auto [low, high] =
            std::minmax({grid[j][i], grid[j][i + 1], grid[j + 1][i], grid[j + 1][i + 1]});
        if (high - low <= kSlow) continue;
        const int x = i * kStep + 1, y = j * kStep + 1;
        wanted[y][x] = wanted[y - 1][x] = wanted[y + 1][x] = wanted[y][x - 1] = wanted[y][x + 1] =
            true;
      }
    }
    Lookup lookup(*this);
    for (int y = 0; y < kCorners; ++y) {
      for (int x = 0; x < kCorners; ++x) {
        if (wanted[y][x])
          lookup.add(square.x + kCorner + x, square.y + kCorner + y, &corners[y][x]);
      }
    }
    lookup.look();
    for (int y = 0; y < kSquare; ++y)
      eightAt(visible[y]) = 0.25f * (eightAt(corners[y]) + eightAt(corners[y] + 1) +
                                     eightAt(corners[y + 1]) + eightAt(corners[y + 1] + 1));
    write(square, here, visible);
  }

  static void interpolate(const float (&grid)[kPlaces][kPlaces],
                          float (&corners)[kCorners][kCorners]) {
    static_assert(kSquare == 8 && kStep == 2);
    for (int j = 0; j < kPlaces; ++j) {
      const float* g = grid[j];
      const Eight left = {g[0], g[0], g[1], g[1], g[2], g[2], g[3], g[3]},
                  right = {g[1], g[1], g[2], g[2], g[3], g[3], g[4], g[4]},
                  parts = {0.0f, 0.5f, 0.0f, 0.5f, 0.0f, 0.5f, 0.0f, 0.5f};
      eightAt(corners[2 * j]) = left + (right - left) * parts;
      corners[2 * j][kSquare] = g[kPlaces - 1];
    }
    for (int j = 1; j < kCorners; j += 2) {
      for (int i = 0; i < kCorners; ++i)
        corners[j][i] = 0.5f * (corners[j - 1][i] + corners[j + 1][i]);
    }
  }

  void write(const cv::Rect& square, const cv::Rect& here,
             const float (&visible)[kSquare][kSquare]) const {
    const int left = here.x + rect_.x - square.x;
    for (int y = here.y; y < here.br().y; ++y) {
      const EightBytes levels = lightLevels(eightAt(visible[y + rect_.y - square.y]));
      std::memcpy(out_.ptr<std::uint8_t>(y) + here.x,
                  reinterpret_cast<const std::uint8_t*>(&levels) + left, here.width);
    }
  }

  // What the pixels of a square and those around it see, each on its own.
  struct Exact {
    float visible[kSquare + 2][kSquare + 2];  // kUnseen: neither relief nor plane

    // Whether those around the square's pixel (x, y) differ by much.
    bool bordersShade(int x, int y) const {
      float low = 1.0f, high = 0.0f;
      for (int j = y; j < y + 3; ++j) {
        for (int i = x; i < x + 3; ++i) {
          if (visible[j][i] == kUnseen) continue;
          low = std::min(low, visible[j][i]), high = std::max(high, visible[j][i]);
        }
      }
      return high - low > kSlow;
    }

    // Mean of the pixel and those around it, the nearer the more.
    float meanAround(int x, int y) const {
      float sum = 0.0f, weights = 0.0f;
      for (int j = 0; j < 3; ++j) {
        for (int i = 0; i < 3; ++i) {
          const float seen = visible[y + j][x + i],
                      weight = static_cast<float>((2 - std::abs(i - 1)) * (2 - std::abs(j - 1)));
          if (seen != kUnseen) sum += weight * seen, weights += weight;
        }
      }
      return sum / weights;
    }
  };

  // Does the surface that a pixel sees end beside it? Then the picture mixes both there.
  bool endsBeside(int u, int v) const {
    Receiver own, other;
    if (!view_.at(static_cast<float>(u), static_cast<float>(v), own)) return false;
    float least = std::numeric_limits<float>::max(), off = 0.0f;
    for (const cv::Point d : {cv::Point(1, 0), {0, 1}, {-1, 0}, {0, -1}}) {
      if (!view_.at(static_cast<float>(u + d.x), static_cast<float>(v + d.y), other)) continue;
      const Eigen::Vector3f way = other.position - own.position;
      least = std::min(least, way.norm());
      off = std::max(off, std::abs(own.normal.dot(way)));
    }
    return off > kEnds * least;
  }

  // Every pixel on its own: the relief, or several planes. Those at a shadow's border have the mean
  // of what their corners see, as on planes; where a surface ends, too, that of all around. What
  // sees neither keeps its value.
  void fillExactly(const cv::Rect& square, const cv::Rect& here) const {
    const cv::Rect own = here + rect_.tl() - square.tl();  // of the square's pixels
    Exact exact;
    Lookup lookup(*this);
    for (int y = own.y; y < own.br().y + 2; ++y) {
      for (int x = own.x; x < own.br().x + 2; ++x)
        lookup.add(static_cast<float>(square.x + x - 1), static_cast<float>(square.y + y - 1),
                   &exact.visible[y][x], kUnseen);
    }
    lookup.look();
    float visible[kSquare][kSquare] = {}, corners[kSquare][kSquare][4];
    bool mixed[kSquare][kSquare] = {};
    for (int y = own.y; y < own.br().y; ++y) {
      const std::uint8_t* kept = out_.ptr<std::uint8_t>(y - own.y + here.y) + here.x - own.x;
      for (int x = own.x; x < own.br().x; ++x) {
        const float centre = exact.visible[y + 1][x + 1];
        visible[y][x] = centre == kUnseen ? kept[x] / 255.0f : centre;
        mixed[y][x] = centre != kUnseen && exact.bordersShade(x, y);
        for (int k = 0; k < 4 && mixed[y][x]; ++k)
          lookup.addBeside(square.x + x, square.y + y, kCorner + (k & 1), kCorner + (k >> 1),
                           &corners[y][x][k]);
      }
    }
    lookup.look();
    for (int y = own.y; y < own.br().y; ++y) {
      for (int x = own.x; x < own.br().x; ++x) {
        const float* c = corners[y][x];
        if (mixed[y][x])
          visible[y][x] = endsBeside(square.x + x, square.y + y)
                              ? exact.meanAround(x, y)
                              : 0.25f * (c[0] + c[1] + c[2] + c[3]);
      }
    }
    write(square, here, visible);
  }

  const PlaceView& view_;
  const Visibility& light_;
  const cv::Rect rect_;
  const SquareMask& skip_;
  cv::Mat& out_;
  SquareMask* shaded_;
};

}  // namespace

CALIPSO_WIDE_LOOPS void veilLevels(const cv::Mat& veil, int v, int begin, int end,
                                   std::uint8_t* levels) {
  if (veil.empty()) return;
  const std::uint8_t* over = veil.ptr<std::uint8_t>(v) + begin;
  for (int k = 0; k < end - begin; ++k)
    levels[k] = static_cast<std::uint8_t>(255 - bothLevels(255 - levels[k], 255 - over[k]));
}

void planesInLight(const PlaceView& view, const Visibility& light, const cv::Rect& rect,
                   const SquareMask& skip, cv::Mat& out, SquareMask* shaded) {
  if (!rect.empty()) Squares(view, light, rect, skip, out, shaded).run();
}

void takeReliefSky(const Relief& relief, const ReliefSky& on_walls, int v, int begin, int end,
                   std::uint8_t* sky) {
  if (relief.empty()) return;
  const std::uint8_t* seen = relief.seen.ptr<std::uint8_t>(v) + begin;
  const int count = end - begin;
  for (int k = nextMarked(seen, 0, count); k < count; k = nextMarked(seen, k + 1, count))
    sky[k] = lightLevel(skyLight(on_walls.at(begin + k, v)));
}

}  // namespace calipso::render
