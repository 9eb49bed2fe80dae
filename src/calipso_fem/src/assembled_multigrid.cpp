#include <stdexcept>

#include "multigrid.hpp"

namespace calipso::fem {
namespace {

class AssembledMultigrid : public Preconditioner {
 public:
  explicit AssembledMultigrid(const VolumeMesh& mesh)
      : cycle_(mesh.lattice), nodes_(mesh.nodeCount()) {}

  bool update(const BlockMatrix& A) override { return cycle_.update(A); }

  bool widen() override { return cycle_.widen(); }

  void apply(const Vec& r, Vec& z) override {
    z.resize(r.size());
    const double norm = r.norm(), scale = norm > 0.0 ? norm : 1.0;
    runParallel([&](const Crew& crew) {
      const auto [begin, end] = crew.share(nodes_, Multigrid::kGrain);
      for (int i = begin; i < end; ++i)
        for (int c = 0; c < 3; ++c)
          cycle_.rightSide()[4L * i + c] = static_cast<float>(r[3 * i + c] / scale);
      crew.barrier();
      cycle_.cycle(crew);
      crew.barrier();
      for (int i = begin; i < end; ++i)
        for (int c = 0; c < 3; ++c) z[3 * i + c] = scale * cycle_.result()[4L * i + c];
    });
  }

 private:
  Multigrid cycle_;
  int nodes_;
};

}  // namespace

std::unique_ptr<Preconditioner> makeMultigrid(const VolumeMesh& mesh) {
  if (mesh.lattice.rows() != mesh.nodes.rows())
    throw std::invalid_argument("multigrid: the mesh has no lattice; use incomplete_cholesky");
  return std::make_unique<AssembledMultigrid>(mesh);
}

}  // namespace calipso::fem
