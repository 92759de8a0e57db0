# From a measured loop of a piezo stack to a compensator in C: the voltages for wanted displacements.
hysim example piezo.csv
hysim columns piezo.csv
hysim metrics piezo.csv --plot loop.svg
hysim identify piezo.csv --model prandtl-ishlinskii --plays 6 --one-signed yes --out stack.json --plot fit.svg
hysim control stack.json --record piezo.csv --sample-time 1e-3 --controller tracking --out controller.json
hysim c stack.json --inverse --out compensator.c
printf '%s\n' 0.1 0.8 1.5 2.2 1.6 0.9 1.2 > wanted.txt
cc -std=c99 -O2 -ffp-contract=off compensator.c compensator_main.c -lm -o compensator
./compensator < wanted.txt > voltages.txt
hysim simulate stack.json voltages.txt --out reached.csv
