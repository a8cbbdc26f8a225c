#include "solvers/multigrid/block_kernels.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <array>

#include "base/index.hpp"

namespace malleus {
namespace {

/// A column of a block is read as a whole register of `Lanes` numbers; lanes beyond the block hold its neighbour's
/// numbers and are never stored.
template <class T, int B>
struct Column {
  static constexpr int lanes = B <= 2 ? B : (B <= 4 ? 4 : 8);
  using Register = Eigen::Array<T, lanes, 1>;

  static Register load(const T* values) { return Eigen::Map<const Register>(values); }
  static Register load_vector(const T* values) {
    Register result = Register::Zero();
    for (int i = 0; i < B; ++i) result[i] = values[i];
    return result;
  }
  static void store(const Register& sum, T* values) {
    for (int i = 0; i < B; ++i) values[i] = sum[i];
  }
};

/// A sum of products of blocks with vectors, in independent parts: one would wait for each addition to end.
template <class T, int B>
struct Sum {
  using K = Column<T, B>;
  static constexpr int parts = std::min(B, 3);
  std::array<typename K::Register, parts> part;

  explicit Sum(const typename K::Register& first) {
    part[0] = first;
    for (std::size_t i = 1; i < parts; ++i) part[i].setZero();
  }
  void add(const T* block, const T* x) {
    for (int c = 0; c < B; ++c) part[static_cast<std::size_t>(c % parts)] += K::load(block + c * B) * x[c];
  }
  void subtract(const T* block, const T* x) {
    for (int c = 0; c < B; ++c) part[static_cast<std::size_t>(c % parts)] -= K::load(block + c * B) * x[c];
  }
  typename K::Register total() const {
    typename K::Register result = part[0];
    for (std::size_t i = 1; i < parts; ++i) result += part[i];
    return result;
  }
};

/// x_row = x_row (or 0) + D^-1 rest.
template <int B, class T>
void correct(const SweepMatrix<T>& matrix, LocalId row, const typename Column<T, B>::Register& rest, bool from_zero,
             T* x) {
  using K = Column<T, B>;
  T* place = x + index(row) * B;
  Sum<T, B> solution(from_zero ? K::Register::Zero() : K::load_vector(place));
  solution.add(matrix.inverses + index(row) * B * B, rest.data());
  K::store(solution.total(), place);
}

template <int B, class T>
void forward_from_zero(const SweepMatrix<T>& matrix, const T* b, T* x) {
  const BlockGraph& graph = *matrix.graph;
  for (LocalId row = 0; row < graph.rows(); ++row) {
    Sum<T, B> rest(Column<T, B>::load_vector(b + index(row) * B));
    for (LocalId k = graph.offsets[index(row)]; k < graph.diagonals[index(row)]; ++k) {
      rest.subtract(matrix.values->at(k), x + index(graph.columns[index(k)]) * B);
    }
    correct<B>(matrix, row, rest.total(), true, x);
  }
}

template <int B, class T>
void upper_residual(const SweepMatrix<T>& matrix, const T* x, T* residual) {
  using K = Column<T, B>;
  const BlockGraph& graph = *matrix.graph;
  for (LocalId row = 0; row < graph.rows(); ++row) {
    Sum<T, B> sum(K::Register::Zero());
    for (LocalId k = graph.diagonals[index(row)] + 1; k < graph.offsets[index(row) + 1]; ++k) {
      sum.subtract(matrix.values->at(k), x + index(graph.columns[index(k)]) * B);
    }
    K::store(sum.total(), residual + index(row) * B);
  }
}

template <int B, class T>
void subtract_rows(const SweepMatrix<T>& matrix, const T* x, T* b) {
  using K = Column<T, B>;
  const BlockGraph& graph = *matrix.graph;
  for (LocalId row = 0; row < graph.rows(); ++row) {
    Sum<T, B> rest(K::load_vector(b + index(row) * B));
    for (LocalId k = graph.offsets[index(row)]; k < graph.offsets[index(row) + 1]; ++k) {
      rest.subtract(matrix.values->at(k), x + index(graph.columns[index(k)]) * B);
    }
    K::store(rest.total(), b + index(row) * B);
  }
}

/// x_row += D^-1 (b - A x)_row, for all rows in increasing order.
template <int B, class T>
void relax_forward(const SweepMatrix<T>& matrix, const T* b, T* x) {
  const BlockGraph& graph = *matrix.graph;
  for (LocalId row = 0; row < graph.rows(); ++row) {
    Sum<T, B> rest(Column<T, B>::load_vector(b + index(row) * B));
    for (LocalId k = graph.offsets[index(row)]; k < graph.offsets[index(row) + 1]; ++k) {
      rest.subtract(matrix.values->at(k), x + index(graph.columns[index(k)]) * B);
    }
    correct<B>(matrix, row, rest.total(), false, x);
  }
}

/// The same in decreasing order, the entries of a row too: memory is then read as one descending stream.
template <int B, class T>
void relax_backward(const SweepMatrix<T>& matrix, const T* b, T* x) {
  const BlockGraph& graph = *matrix.graph;
  for (LocalId row = graph.rows() - 1; row >= 0; --row) {
    Sum<T, B> rest(Column<T, B>::load_vector(b + index(row) * B));
    for (LocalId k = graph.offsets[index(row) + 1] - 1; k >= graph.offsets[index(row)]; --k) {
      rest.subtract(matrix.values->at(k), x + index(graph.columns[index(k)]) * B);
    }
    correct<B>(matrix, row, rest.total(), false, x);
  }
}

template <int B, int C, class T>
void prolong(const BlockGraph& graph, const BlockValues<T>& p, const T* coarse, T* fine) {
  using K = Column<T, B>;
  for (LocalId row = 0; row < graph.rows(); ++row) {
    typename K::Register sum = K::load_vector(fine + index(row) * B);
    for (LocalId k = graph.offsets[index(row)]; k < graph.offsets[index(row) + 1]; ++k) {
      const T* block = p.at(k);
      const T* from = coarse + index(graph.columns[index(k)]) * C;
      for (int c = 0; c < C; ++c) sum += K::load(block + c * B) * from[c];
    }
    K::store(sum, fine + index(row) * B);
  }
}

template <int B, int C, class T>
void restrict_to(const BlockGraph& graph, const BlockValues<T>& p, const T* fine, T* coarse) {
  for (LocalId row = 0; row < graph.rows(); ++row) {
    const T* from = fine + index(row) * B;
    for (LocalId k = graph.offsets[index(row)]; k < graph.offsets[index(row) + 1]; ++k) {
      const T* block = p.at(k);
      T* to = coarse + index(graph.columns[index(k)]) * C;
      for (int c = 0; c < C; ++c) {
        T sum = 0;
        for (int r = 0; r < B; ++r) sum += block[c * B + r] * from[r];
        to[c] += sum;
      }
    }
  }
}

}  // namespace

template <class T>
void sweep_forward_from_zero(const SweepMatrix<T>& matrix, const T* b, T* x) {
  with_block(matrix.values->rows, [&](auto block) { forward_from_zero<block>(matrix, b, x); });
}

template <class T>
void residual_after_forward(const SweepMatrix<T>& matrix, const T* x, T* residual) {
  with_block(matrix.values->rows, [&](auto block) { upper_residual<block>(matrix, x, residual); });
}

template <class T>
void subtract_product(const SweepMatrix<T>& matrix, const T* x, T* b) {
  with_block(matrix.values->rows, [&](auto block) { subtract_rows<block>(matrix, x, b); });
}

template <class T>
void sweep_backward(const SweepMatrix<T>& matrix, const T* b, T* x) {
  with_block(matrix.values->rows, [&](auto block) { relax_backward<block>(matrix, b, x); });
}

template <class T>
void sweep_forward(const SweepMatrix<T>& matrix, const T* b, T* x) {
  with_block(matrix.values->rows, [&](auto block) { relax_forward<block>(matrix, b, x); });
}

template <class T>
void add_prolonged(const BlockGraph& graph, const BlockValues<T>& p, const T* coarse, T* fine) {
  with_blocks(p.rows, p.columns, [&](auto rows, auto columns) { prolong<rows, columns>(graph, p, coarse, fine); });
}

template <class T>
void restrict_rows(const BlockGraph& graph, const BlockValues<T>& p, const T* fine, LocalId coarse_blocks, T* coarse) {
  std::fill_n(coarse, index(coarse_blocks) * static_cast<std::size_t>(p.columns), T(0));
  with_blocks(p.rows, p.columns, [&](auto rows, auto columns) { restrict_to<rows, columns>(graph, p, fine, coarse); });
}

template void sweep_forward_from_zero(const SweepMatrix<float>&, const float*, float*);
template void sweep_forward_from_zero(const SweepMatrix<double>&, const double*, double*);
template void residual_after_forward(const SweepMatrix<float>&, const float*, float*);
template void residual_after_forward(const SweepMatrix<double>&, const double*, double*);
template void subtract_product(const SweepMatrix<float>&, const float*, float*);
template void subtract_product(const SweepMatrix<double>&, const double*, double*);
template void sweep_backward(const SweepMatrix<float>&, const float*, float*);
template void sweep_backward(const SweepMatrix<double>&, const double*, double*);
template void sweep_forward(const SweepMatrix<float>&, const float*, float*);
template void sweep_forward(const SweepMatrix<double>&, const double*, double*);
template void add_prolonged(const BlockGraph&, const BlockValues<float>&, const float*, float*);
template void add_prolonged(const BlockGraph&, const BlockValues<double>&, const double*, double*);
template void restrict_rows(const BlockGraph&, const BlockValues<float>&, const float*, LocalId, float*);
template void restrict_rows(const BlockGraph&, const BlockValues<double>&, const double*, LocalId, double*);

}  // namespace malleus
