#pragma once

#include "calipso_flow/deformation_field.hpp"

namespace calipso::flow {

// G of the mean square displacement over the vertices, c^T G c.
// @param weights  of the field at the vertices
Eigen::MatrixXd meanSquare(const DeformationField::Weights& weights);

// Displacements of the vertices, 3 #V.
Eigen::VectorXd vertexShape(const DeformationField::Weights& weights,
                            const Eigen::VectorXd& controls);

}  // namespace calipso::flow
