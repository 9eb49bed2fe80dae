#pragma once

// The inner loops of the contacts' dense algebra, with the vector instructions the processor has.
// Private.
namespace calipso::fem {

// y += a[0] x + a[1] (x + stride) + a[2] (x + 2 stride), each of length n.
void addThree(const double* x, long stride, const double a[3], int n, double* y);

// Weighted places on the nodes of a body, each with axes of its own.
struct PlaceList {
  const int* start;  // count + 1
  const int* node;
  const double* weight;
  const double* frames;  // 3x3 each, column by column
};

// out_j = sum_k w_jk columns_k F_j^T for the first `count` places; columns: 3x3 per node, out: 3x3
// per place, all column by column.
void projectOnto(const PlaceList& places, int count, const double* columns, double* out);

}  // namespace calipso::fem
