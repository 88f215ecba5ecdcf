// A soft arm, 120 mm long, 36 mm wide and high at its base and 24 mm at its tip. Lengths in metres.
//   gmsh arm.geo -3 -format msh41 -o arm.msh
// Another arm, without editing: gmsh arm.geo -setnumber size 0.010 -3 -format msh41 -o finer.msh
DefineConstant[length = 0.12, base = 0.018, tip = 0.012, size = 0.014];  // base and tip: half widths; size: edges of tetrahedra
Point(1) = {0, -base, -base};
Point(2) = {0, base, -base};
Point(3) = {0, base, base};
Point(4) = {0, -base, base};
Point(5) = {length, -tip, -tip};
Point(6) = {length, tip, -tip};
Point(7) = {length, tip, tip};
Point(8) = {length, -tip, tip};
For k In {1:4}
  next = k % 4 + 1;
  Line(k) = {k, next};
  Line(4 + k) = {4 + k, 4 + next};
  Line(8 + k) = {k, 4 + k};
EndFor
Curve Loop(1) = {1, 2, 3, 4};
Curve Loop(2) = {5, 6, 7, 8};
For k In {1:4}
  next = k % 4 + 1;
  Curve Loop(2 + k) = {k, 8 + next, -(4 + k), -(8 + k)};
EndFor
For k In {1:6}
  Plane Surface(k) = {k};
EndFor
Surface Loop(1) = {1:6};
Volume(1) = {1};
MeshSize{:} = size;
Physical Surface("base") = {1};
Physical Volume("silicone") = {1};
