#pragma once

#include <vector>

#include "calipso_fem/deformable_body.hpp"
#include "case_reader.hpp"

// One function per family of reference cases; each prints its results.
namespace calipso::fem {

void evaluateBoxLoads(const CaseFile& file);     // A, B, H
void evaluateTorsion(const CaseFile& file);      // C
void evaluateHomogeneous(const CaseFile& file);  // D
void evaluateCook(const CaseFile& file);         // E
void evaluateDynamics(const CaseFile& file);     // F
void evaluateModes(const CaseFile& file);        // G
void evaluateShapes(const CaseFile& file);       // I
void evaluateElements(const CaseFile& file);     // J

// The two ways the elements of the reference tables are named.
ElementType referenceElement(const std::string& name);  // Q1 or P1

// Options for comparison with tables: converged far beyond what they list.
FemOptions exactOptions(MaterialModel model, ElementType element);

void addReport(const StepReport& report, ResultLine* line);

}  // namespace calipso::fem
