"""A second set of disturbances, written from physics and literature alone.

Whoever wrote this folder had not read the effects, the selection and the simulation of the diagnosis, nor
the files of the first set of disturbances. Known were the contract's names of families, the catalogue's
ranges (gap.md, section 5), the hooks along the chain, and the numbers and units that the first set's labels
hold at severities of 0.05, 0.5 and 1, printed and not read in code; so the same severity means the same
size in both sets.

Each family follows another formula than its usual one where physics has another (form T1); where there is
only one, as for a rigid body that is fixed to a link, it is that one (T0). A parameter whose meaning is the
same has the name of the first set's label. The kinds outside the catalogue (T2) are others than those of
the first set.
"""
