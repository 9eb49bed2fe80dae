#pragma once

#include <memory>
#include <string>
#include <vector>

#include "calipso_fem/block_matrix.hpp"
#include "calipso_fem/material_model.hpp"
#include "calipso_fem/volume_mesh.hpp"

// Elastic forces of a volume mesh (paper: section 4.1, eqs. 3, 4). SI units.
//  paper  code              meaning                                unit
//  u      x - X             nodal displacements, 3n                m
//  f      gradient(x)       internal forces dPsi/dx, 3n            N
//  K      hessian(x)        tangent stiffness, 3n x 3n             N/m
//  K_e    elementStiffness  one element's stiffness at rest        N/m
namespace calipso::fem {

class StvkHexes;

enum class ElementType {
  kHexQ1,              // trilinear, 2x2x2 Gauss points
  kHexMeanDilatation,  // trilinear, one dilatation per element (F-bar): for nu near 0.5
  kHexEnhanced,  // enhanced strain modes, condensed: locks neither in bending nor near nu = 0.5
  kTetP1         // linear tetrahedron
};

std::string toString(ElementType element);
ElementType elementTypeFromString(const std::string& name);  // @throw std::invalid_argument

enum class Definiteness { kExact, kPositive };  // kPositive: each element's part is projected

// The elastic energy of one body. Holds its own copy of the mesh. Const calls may run in parallel.
class ElasticModel {
 public:
  // @throw std::invalid_argument for a bad mesh or material, or an element that does not fit the
  // mesh
  ElasticModel(VolumeMesh mesh, const Material& material, MaterialModel model, ElementType element);
  ~ElasticModel();
  ElasticModel(ElasticModel&&) noexcept;

  const VolumeMesh& mesh() const;
  MaterialModel model() const;
  ElementType element() const;
  int dofCount() const;

  // E, nu and rho of the whole body, or of each cell. @throw std::invalid_argument
  void setMaterial(const Material& material);
  void setCellMaterials(const std::vector<Material>& materials);
  const std::vector<Material>& cellMaterials() const;
  // New rest positions of the nodes, m. @throw std::invalid_argument for an inverted cell
  void setRestPositions(const NodeMatrix& nodes);

  // x: current nodal positions, 3n, m. energy() is zero at rest.
  double energy(const Vec& x) const;
  void gradient(const Vec& x, Vec& f) const;
  void hessian(const Vec& x, Definiteness definiteness, BlockMatrix& K) const;
  // K without the geometric part: the viscosity of stiffness-proportional damping per unit of its
  // coefficient. Positive semi-definite; rigid velocities give no force.
  void viscosity(const Vec& x, BlockMatrix& D) const;

  // The cells packed for products without a matrix; null where material or element have none. Built
  // anew by every change of material or rest shape.
  const StvkHexes* hexes() const;

  const std::shared_ptr<const BlockPattern>& pattern() const;
  // K at rest, weighted by filled fraction and element material.
  Eigen::SparseMatrix<double> linearStiffness() const;
  // K_e of one cell, dof = 3 corner + component.
  Eigen::MatrixXd elementStiffness(int cell) const;

  // Row sums of the mass matrix, #N, kg.
  const Eigen::VectorXd& lumpedMass() const;
  // Consistent mass on the pattern of K.
  BlockMatrix consistentMass() const;
  double totalMass() const;

  // Von Mises stress, mean over each cell, #C, Pa.
  Eigen::VectorXd cellVonMises(const Vec& x) const;
  // F = dx/dX at the centre of one cell.
  Eigen::Matrix3d centerGradient(int cell, const Vec& x) const;
  // Smallest det F over all integration points: <= 0 where an element is inverted.
  double smallestDilatation(const Vec& x) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace calipso::fem
