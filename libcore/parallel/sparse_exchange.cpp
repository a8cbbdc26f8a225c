#include "parallel/sparse_exchange.hpp"

#include <algorithm>

#include "base/error.hpp"

namespace malleus {
namespace {

constexpr int size_tags[2] = {71, 73};
constexpr int data_tags[2] = {72, 74};

/// Posts the transfers of one parcel in pieces that an int can count.
template <class Post>
void in_pieces(std::size_t bytes, std::size_t piece_bytes, Post post) {
  for (std::size_t start = 0; start < bytes; start += piece_bytes) {
    post(start, static_cast<int>(std::min(piece_bytes, bytes - start)));
  }
}

void receive_parcel(MPI_Comm comm, int source, int parity, std::size_t piece_bytes, std::vector<Parcel>& received,
                    std::vector<MPI_Request>& requests) {
  std::uint64_t bytes = 0;
  MPI_Recv(&bytes, 1, MPI_UINT64_T, source, size_tags[parity], comm, MPI_STATUS_IGNORE);
  Parcel& parcel = received.emplace_back(Parcel{source, std::vector<std::byte>(bytes)});
  in_pieces(bytes, piece_bytes, [&](std::size_t start, int count) {
    MPI_Irecv(parcel.bytes.data() + start, count, MPI_BYTE, source, data_tags[parity], comm, &requests.emplace_back());
  });
}

}  // namespace

std::vector<Parcel> sparse_exchange(const Communicator& comm, std::vector<Parcel> outgoing, std::size_t piece_bytes) {
  const MPI_Comm raw = comm.raw();
  const int parity = comm.next_exchange_parity();
  std::vector<std::uint64_t> sizes(outgoing.size());
  std::vector<MPI_Request> size_sends(outgoing.size());
  std::vector<MPI_Request> data;
  for (std::size_t i = 0; i < outgoing.size(); ++i) {
    Parcel& parcel = outgoing[i];
    check(parcel.rank >= 0 && parcel.rank < comm.size(), "parcel is addressed to a rank");
    sizes[i] = parcel.bytes.size();
    MPI_Issend(&sizes[i], 1, MPI_UINT64_T, parcel.rank, size_tags[parity], raw, &size_sends[i]);
    in_pieces(parcel.bytes.size(), piece_bytes, [&](std::size_t start, int count) {
      MPI_Isend(parcel.bytes.data() + start, count, MPI_BYTE, parcel.rank, data_tags[parity], raw,
                &data.emplace_back());
    });
  }

  std::vector<Parcel> received;
  MPI_Request everyone_sent = MPI_REQUEST_NULL;
  bool in_barrier = false;
  for (int finished = 0; finished == 0;) {
    int arrived = 0;
    MPI_Status status;
    MPI_Iprobe(MPI_ANY_SOURCE, size_tags[parity], raw, &arrived, &status);
    if (arrived != 0) receive_parcel(raw, status.MPI_SOURCE, parity, piece_bytes, received, data);
    if (in_barrier) {
      MPI_Test(&everyone_sent, &finished, MPI_STATUS_IGNORE);
      continue;
    }
    int sent = 0;
    MPI_Testall(static_cast<int>(size_sends.size()), size_sends.data(), &sent, MPI_STATUSES_IGNORE);
    if (sent != 0) {
      MPI_Ibarrier(raw, &everyone_sent);
      in_barrier = true;
    }
  }
  MPI_Waitall(static_cast<int>(data.size()), data.data(), MPI_STATUSES_IGNORE);
  std::sort(received.begin(), received.end(), [](const Parcel& a, const Parcel& b) { return a.rank < b.rank; });
  return received;
}

}  // namespace malleus
