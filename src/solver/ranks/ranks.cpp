#include "espalier/ranks.hpp"

#include "espalier/nodes.hpp"
#include "ranks/communicator.hpp"
#include "solver/ranks/on_all_ranks.hpp"

namespace espalier {

Ranks::Ranks(const espalier_rank_functions& functions, double patience)
    : link_(std::make_shared<ranks::Communicator>(functions, patience)) {}

int Ranks::rank() const { return link_ ? link_->rank() : 0; }
int Ranks::size() const { return link_ ? link_->size() : 1; }
std::string Ranks::name_of(int rank) const { return link_ ? link_->name_of(rank) : "rank 0"; }

void set_nodes(const Ranks& ranks, Nodes nodes) {
  if (ranks.link()) ranks.link()->set_machines(nodes == Nodes::process ? 1 : 0);
}

namespace solver {

Status on_all_ranks(ranks::Communicator& link, const std::function<Status()>& body) {
  Status own;
  std::exception_ptr misuse;
  try {
    link.begin_call();
  } catch (const Error& e) {
    return e.status();
  }
  try {
    own = body();
  } catch (const std::exception& e) {
    misuse = std::current_exception();
    own = {StatusCode::invalid_input, e.what(), -1};
  }
  Status all = link.end_call(std::move(own));
  if (misuse) std::rethrow_exception(misuse);
  return all;
}

}  // namespace solver
}  // namespace espalier
