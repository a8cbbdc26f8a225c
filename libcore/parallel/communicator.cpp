#include "parallel/communicator.hpp"

#include <limits>
#include <numeric>

#include "base/error.hpp"

namespace malleus {
namespace {

template <class T>
MPI_Datatype mpi_type();
template <>
MPI_Datatype mpi_type<Real>() {
  return MPI_DOUBLE;
}
template <>
MPI_Datatype mpi_type<GlobalId>() {
  return MPI_INT64_T;
}

template <class T>
T reduce(MPI_Comm comm, T mine, MPI_Op operation) {
  T result{};
  MPI_Allreduce(&mine, &result, 1, mpi_type<T>(), operation, comm);
  return result;
}

int int_count(std::size_t count) {
  check(count <= static_cast<std::size_t>(std::numeric_limits<int>::max()), "message count fits an int");
  return static_cast<int>(count);
}

template <class T>
void reduce_in_place(MPI_Comm comm, std::span<T> values, MPI_Op operation) {
  MPI_Allreduce(MPI_IN_PLACE, values.data(), int_count(values.size()), mpi_type<T>(), operation, comm);
}

}  // namespace

Communicator::Communicator(MPI_Comm parent) {
  MPI_Comm_dup(parent, &comm_);
  MPI_Comm_rank(comm_, &rank_);
  MPI_Comm_size(comm_, &size_);
}

Communicator::~Communicator() {
  int finalized = 0;
  MPI_Finalized(&finalized);
  if (finalized == 0) MPI_Comm_free(&comm_);
}

Real Communicator::sum(Real mine) const {
  return reduce(comm_, mine, MPI_SUM);
}
GlobalId Communicator::sum(GlobalId mine) const {
  return reduce(comm_, mine, MPI_SUM);
}
Real Communicator::max(Real mine) const {
  return reduce(comm_, mine, MPI_MAX);
}
GlobalId Communicator::max(GlobalId mine) const {
  return reduce(comm_, mine, MPI_MAX);
}
Real Communicator::min(Real mine) const {
  return reduce(comm_, mine, MPI_MIN);
}
GlobalId Communicator::min(GlobalId mine) const {
  return reduce(comm_, mine, MPI_MIN);
}
bool Communicator::all(bool mine) const {
  return min(static_cast<GlobalId>(mine)) == 1;
}
bool Communicator::any(bool mine) const {
  return max(static_cast<GlobalId>(mine)) == 1;
}

void Communicator::sum_in_place(std::span<Real> values) const {
  reduce_in_place(comm_, values, MPI_SUM);
}
void Communicator::sum_in_place(std::span<GlobalId> values) const {
  reduce_in_place(comm_, values, MPI_SUM);
}
void Communicator::max_in_place(std::span<Real> values) const {
  reduce_in_place(comm_, values, MPI_MAX);
}
void Communicator::min_in_place(std::span<Real> values) const {
  reduce_in_place(comm_, values, MPI_MIN);
}

GlobalId Communicator::sum_of_lower_ranks(GlobalId mine) const {
  GlobalId result = 0;
  MPI_Exscan(&mine, &result, 1, MPI_INT64_T, MPI_SUM, comm_);
  return rank_ == 0 ? 0 : result;
}

std::vector<GlobalId> Communicator::gather_to_all(GlobalId mine) const {
  std::vector<GlobalId> all(static_cast<std::size_t>(size_));
  MPI_Allgather(&mine, 1, MPI_INT64_T, all.data(), 1, MPI_INT64_T, comm_);
  return all;
}

std::vector<Real> Communicator::gather_to_all(Real mine) const {
  std::vector<Real> all(static_cast<std::size_t>(size_));
  MPI_Allgather(&mine, 1, MPI_DOUBLE, all.data(), 1, MPI_DOUBLE, comm_);
  return all;
}

std::vector<std::string> Communicator::gather_to_root(const std::string& mine) const {
  const int length = int_count(mine.size());
  std::vector<int> lengths(is_root() ? static_cast<std::size_t>(size_) : 0);
  MPI_Gather(&length, 1, MPI_INT, lengths.data(), 1, MPI_INT, 0, comm_);
  std::vector<int> starts(lengths.size());
  std::exclusive_scan(lengths.begin(), lengths.end(), starts.begin(), 0);
  std::string joined(is_root() ? static_cast<std::size_t>(starts.back() + lengths.back()) : 0, ' ');
  MPI_Gatherv(mine.data(), length, MPI_CHAR, joined.data(), lengths.data(), starts.data(), MPI_CHAR, 0, comm_);
  std::vector<std::string> texts;
  for (std::size_t i = 0; i < lengths.size(); ++i) {
    texts.push_back(joined.substr(static_cast<std::size_t>(starts[i]), static_cast<std::size_t>(lengths[i])));
  }
  return texts;
}

void Communicator::broadcast(std::string& text, int root) const {
  auto length = static_cast<std::int64_t>(text.size());
  MPI_Bcast(&length, 1, MPI_INT64_T, root, comm_);
  text.resize(static_cast<std::size_t>(length));
  MPI_Bcast(text.data(), int_count(text.size()), MPI_CHAR, root, comm_);
}

void Communicator::broadcast(std::span<Real> values, int root) const {
  MPI_Bcast(values.data(), int_count(values.size()), MPI_DOUBLE, root, comm_);
}

void Communicator::broadcast(std::span<GlobalId> values, int root) const {
  MPI_Bcast(values.data(), int_count(values.size()), MPI_INT64_T, root, comm_);
}

bool Communicator::broadcast(bool value, int root) const {
  int flag = value ? 1 : 0;
  MPI_Bcast(&flag, 1, MPI_INT, root, comm_);
  return flag == 1;
}

void Communicator::barrier() const {
  MPI_Barrier(comm_);
}

}  // namespace malleus
