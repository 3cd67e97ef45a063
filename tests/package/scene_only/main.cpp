// Computes the distance from a point to boxes with an installed hamelin::scene.
#include <hamelin/scene/distance.hpp>
#include <iostream>

int main() {
  const hamelin::scene::BoxField field(
      {{{0.0, 0.0, 0.0}, {1.0, 1.0, 1.0}}, {{3.0, 0.0, 0.0}, {4.0, 1.0, 1.0}}});
  hamelin::scene::BoxHit hit;
  if (!field.nearest({1.75, 0.5, 0.5}, 10.0, hit)) return 1;
  std::cout << "distance " << hit.distance << " to box " << hit.box << '\n';
  return hit.distance == 0.75 && hit.box == 0 ? 0 : 1;
}
