#include "beam.hpp"

namespace calipso::fem {

DeformableBody makeBeam(int n, const FemOptions& options) {
  DeformableBody body(boxMesh({0, 0, 0}, {1.0, 0.25, 0.25}, {4 * n, n, n}),
                      Material{1e6, 0.3, 1000.0, 0.0}, options);
  for (int i = 0; i < body.nodeCount(); ++i)
    if (body.model().mesh().nodes(i, 0) == 0.0) body.fixNode(i);
  body.setGravity({0.0, -9.81, 0.0});
  return body;
}

double tipHeight(const DeformableBody& body) {
  double sum = 0.0;
  int count = 0;
  const VolumeMesh& mesh = body.model().mesh();
  for (int i = 0; i < mesh.nodeCount(); ++i)
    if (mesh.nodes(i, 0) > 1.0 - 1e-9) {
      sum += body.positions()[3 * i + 1] - mesh.nodes(i, 1);
      ++count;
    }
  return sum / count;
}

}  // namespace calipso::fem
