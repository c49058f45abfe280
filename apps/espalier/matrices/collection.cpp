#include "matrices/collection.hpp"

namespace espalier::cli {

const std::vector<CollectionMatrix>& collection() {
  static const std::vector<CollectionMatrix> all = {
      {"nd6k", "ND", 18000, 6897316, "3-D mesh, definite"},
      {"nd24k", "ND", 72000, 28715634, "3-D mesh, definite"},
      {"inline_1", "GHS_psdef", 503712, 36816170, "stiffness, definite"},
      {"Fault_639", "Janna", 638802, 27245944, "faulted rock, definite"},
      {"PFlow_742", "Janna", 742793, 37138461, "pressure in rock, definite"},
      {"boneS10", "Oberwolfach", 914898, 40878708, "bone, definite"},
      {"Emilia_923", "Janna", 923136, 40373538, "rock mechanics, definite"},
      {"audikw_1", "GHS_psdef", 943695, 77651847, "crankshaft, definite"},
      {"ldoor", "GHS_psdef", 952203, 42493817, "car door, definite"},
      {"bone010", "Oberwolfach", 986703, 47851783, "bone, definite"},
      {"Serena", "Janna", 1391349, 64131971, "gas reservoir, definite"},
      {"Geo_1438", "Janna", 1437960, 60236322, "rock mechanics, definite"},
      {"StocF-1465", "Janna", 1465137, 21005389, "flow in rock, definite"},
      {"Hook_1498", "Janna", 1498023, 59374451, "steel hook, definite"},
      {"Flan_1565", "Janna", 1564794, 114165372, "steel flange, definite"},
      {"Bump_2911", "Janna", 2911419, 127729899, "gas reservoir, definite"},
      {"Queen_4147", "Janna", 4147110, 316548962, "structure, definite"},
      {"stokes128", "GHS_indef", 49666, 558594, "Stokes flow, indefinite"},
      {"c-73", "Schenk_IBMNA", 169422, 1279274, "optimization, indefinite"},
      {"cont-300", "GHS_indef", 180895, 988195, "optimization, indefinite"},
      {"nlpkkt80", "Schenk", 1062400, 28192672, "optimization, indefinite"},
      {"nlpkkt120", "Schenk", 3542400, 95117792, "optimization, indefinite"},
      {"nlpkkt160", "Schenk", 8345600, 225422112, "optimization, indefinite"},
      {"Long_Coup_dt0", "Janna", 1470152, 84422970, "coupled rock and water, indefinite"},
      {"Long_Coup_dt6", "Janna", 1470152, 84422970, "coupled rock and water, indefinite"},
      {"Cube_Coup_dt0", "Janna", 2164760, 124406070, "coupled rock and water, indefinite"},
      {"Cube_Coup_dt6", "Janna", 2164760, 124406070, "coupled rock and water, indefinite"},
      {"kkt_power", "Zaoui", 2063494, 12771361, "power grid, indefinite"},
  };
  return all;
}

}  // namespace espalier::cli
