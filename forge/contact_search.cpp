#include "forge/contact_search.hpp"

#include <algorithm>
#include <tuple>

namespace malleus::forge {
namespace {

/// Faces of an opponent that differ by less than this cosine are the same in two increments.
constexpr Real same_face = 0.8;
/// Nodes nearer than this share of an edge at the start touch.
constexpr Real touching = 1e-6;
/// Where the memory was lost: nodes expected within this share of an edge hold; those within the other one where they
/// bear this share of their body's mean contact pressure. (Interpolation gives some pressure to new nodes just outside
/// a contact: each that is taken to hold costs some iterations, as it sticks until the first solve has ended.)
constexpr Real closed = 1e-3;
constexpr Real near = 2e-2;
constexpr Real borne_share = 0.2;
/// Parts of a node's area that face its opponent less than this share count as this share.
constexpr Real least_area = 1e-3;

/// What was remembered of a slave against a face of an opponent.
const ContactMemory* recall(const ContactScene& scene, LocalId slave, int opponent, const Vector& normal) {
  const auto begin = std::lower_bound(scene.memory.begin(), scene.memory.end(), std::tuple(slave, opponent),
                                      [](const ContactMemory& m, const std::tuple<LocalId, int>& key) {
                                        return std::tuple(m.slave, m.opponent) < key;
                                      });
  const ContactMemory* best = nullptr;
  for (auto m = begin; m != scene.memory.end() && m->slave == slave && m->opponent == opponent; ++m) {
    const Real likeness = m->normal.dot(normal);
    if (likeness > same_face && (best == nullptr || likeness > best->normal.dot(normal))) best = &*m;
  }
  return best;
}

/// Whether a node held, where only its place and its pressure tell.
bool held_before(const ContactScene& scene, LocalId slave, Real gap) {
  if (scene.last_pressure.empty()) return false;
  const auto body = static_cast<std::size_t>(scene.surface->body_of_node(slave));
  const Real share = gap / scene.bodies[body].edge;
  const Real pressure = scene.last_pressure[static_cast<std::size_t>(slave)];
  return share <= closed || (share <= near && pressure > borne_share * scene.mean_pressure[body]);
}

/// Normal, gap and the velocity of the guess relative to the opponent, which the linearised gap starts from.
struct Meeting {
  Vector normal;
  Real gap = 0;
  Vector guessed_slip = Vector::Zero();
};

/// The gap at the end of the increment is meeting.gap + effective step * normal . (slip - guessed slip).
ContactPoint make_point(const ContactScene& scene, std::size_t place, int opponent, const Meeting& meeting,
                        Real effective_step) {
  const FreeSurface& surface = *scene.surface;
  ContactPoint point;
  point.slave = surface.nodes()[place];
  point.slave_number = surface.mesh().global_node(point.slave);
  point.surface = place;
  point.opponent = opponent;
  point.area = std::max(surface.facing_area(place, meeting.normal), least_area * surface.area(place));
  point.normal.normal = meeting.normal;
  point.normal.offset = meeting.normal.dot(meeting.guessed_slip) - meeting.gap / effective_step;
  const BodyScale& body = scene.bodies[static_cast<std::size_t>(surface.body_of_node(point.slave))];
  point.normal.penalty = scene.settings.penalty * body.viscosity / body.edge;
  const ContactMemory* memory = recall(scene, point.slave, opponent, meeting.normal);
  point.normal.multiplier = memory != nullptr ? memory->multiplier : 0;
  point.holds =
      memory != nullptr || meeting.gap <= touching * body.edge || held_before(scene, point.slave, meeting.gap);
  point.rubs = point.holds;
  if (point.holds && !scene.settings.closes_gaps) point.normal.offset = 0;
  return point;
}

void set_friction(const ContactScene& scene, const FrictionSpec& spec, ContactPoint& point) {
  constexpr Real unlimited = 1e300;
  const BodyScale& body = scene.bodies[static_cast<std::size_t>(scene.surface->body_of_node(point.slave))];
  if (spec.coefficient == 0) {
    if (!body.is_held) point.friction = {scene.settings.holding_friction * body.viscosity / body.edge, 1, 0};
    return;
  }
  const ContactMemory* memory = recall(scene, point.slave, point.opponent, point.normal.normal);
  const bool is_lost = memory == nullptr && point.holds && !scene.last_pressure.empty();
  const Real known = is_lost ? scene.last_pressure[static_cast<std::size_t>(point.slave)] : 0;
  const Real pressure = memory != nullptr ? memory->pressure : known;
  const Real stress =
      scene.shear_stress.empty() ? unlimited : scene.shear_stress[static_cast<std::size_t>(point.slave)];
  const Real softening = scene.softening.empty() ? 1 : scene.softening[static_cast<std::size_t>(point.slave)];
  point.friction = friction_term(spec, body.consistency * softening, stress, pressure, scene.settings.slip_scale);
}

void add_tool_contacts(const ContactScene& scene, const Prediction& prediction, std::vector<ContactPoint>& points) {
  const FreeSurface& surface = *scene.surface;
  std::vector<SurfaceContact> found;
  for (std::size_t place = 0; place < surface.nodes().size(); ++place) {
    const LocalId node = surface.nodes()[place];
    const BodyScale& body = scene.bodies[static_cast<std::size_t>(surface.body_of_node(node))];
    if (!body.is_deformable) continue;
    const Real reach = body.edge + 2 * prediction.largest_motion;
    const Vector& position = prediction.positions[static_cast<std::size_t>(node)];
    for (std::size_t t = 0; t < scene.tools->size(); ++t) {
      const Tool& tool = (*scene.tools)[t];
      found.clear();
      tool.contacts_at_end(position, reach, found);
      const Vector tool_velocity = tool.velocity_at(position);
      for (const SurfaceContact& contact : found) {
        const Meeting meeting = {contact.normal, contact.distance,
                                 prediction.velocities[static_cast<std::size_t>(node)] - tool_velocity};
        ContactPoint point = make_point(scene, place, static_cast<int>(t), meeting, prediction.effective_step);
        point.opponent_velocity = tool_velocity;
        set_friction(scene, tool.friction(), point);
        points.push_back(point);
      }
    }
  }
}

/// Guessed velocities of nodes that other ranks hold, by their global numbers.
std::vector<Real> velocities_in_space(const NodeSpace& space, const Prediction& prediction) {
  std::vector<Real> values(static_cast<std::size_t>(space.nodes()) * 3, 0.0);
  for (LocalId node = 0; node < space.owned(); ++node) {
    for (int c = 0; c < 3; ++c) {
      values[static_cast<std::size_t>(node * 3 + c)] = prediction.velocities[static_cast<std::size_t>(node)][c];
    }
  }
  space.halo().update_copies(values, 3);
  return values;
}

void add_pair_contacts(const Communicator& comm, const ContactScene& scene, const Prediction& prediction,
                       std::size_t index, std::vector<ContactPoint>& points) {
  const BodyPair& pair = scene.pairs[index];
  const BodyScale& slave = scene.bodies[static_cast<std::size_t>(pair.slave)];
  const PairSearch search = {pair.slave, pair.master, slave.edge + 2 * prediction.largest_motion};
  const std::vector<NodeFacetPair> found = find_pairs(comm, *scene.surface, prediction.positions, search);
  std::vector<GlobalId> wanted;
  for (const NodeFacetPair& meeting : found) {
    for (const GlobalId master : meeting.masters) {
      if (master >= 0) wanted.push_back(master);
    }
  }
  const NodeSpace space(comm, scene.surface->mesh(), wanted);
  const std::vector<Real> velocities = velocities_in_space(space, prediction);
  for (const NodeFacetPair& met : found) {
    Vector slip = prediction.velocities[static_cast<std::size_t>(met.slave)];
    for (std::size_t k = 0; k < 3 && met.masters[k] >= 0; ++k) {
      const auto at = static_cast<std::size_t>(space.local_node(met.masters[k])) * 3;
      slip -= met.weights[k] * to_vector(velocities.data() + at, 3);
    }
    ContactPoint point = make_point(scene, met.surface, static_cast<int>(scene.tools->size() + index),
                                    {met.normal, met.gap, slip}, prediction.effective_step);
    if (pair.penalty) point.normal.penalty *= *pair.penalty / scene.settings.penalty;
    point.masters = met.masters;
    point.weights = met.weights;
    set_friction(scene, pair.friction, point);
    points.push_back(point);
  }
}

}  // namespace

std::vector<ContactPoint> find_contacts(const Communicator& comm, const ContactScene& scene,
                                        const Prediction& prediction) {
  std::vector<ContactPoint> points;
  add_tool_contacts(scene, prediction, points);
  for (std::size_t i = 0; i < scene.pairs.size(); ++i) add_pair_contacts(comm, scene, prediction, i, points);
  std::stable_sort(points.begin(), points.end(), [](const ContactPoint& a, const ContactPoint& b) {
    return std::tie(a.slave, a.opponent) < std::tie(b.slave, b.opponent);
  });
  return points;
}

}  // namespace malleus::forge
