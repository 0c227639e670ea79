"""Words of the photo set: each is used once. Names of many languages and everyday words."""

NAMES = """
Aaliyah Abebe Achim Adaeze Agnes Aiko Ainhoa Akira Alba Alfred Amara Amit Anders Anil Anouk Arda Arjun Arvid Asha Astrid
Aylin Azra Bartek Bence Benno Birgit Bjorn Bodil Boris Brigid Bruna Caleb Camila Carmen Cedric Chiara Chidi Chloe Ciara
Conor Cosima Dagmar Damir Daria Dewi Dieter Dilara Dmitri Dolores Dragan Dylan Ebba Eckart Edda Egon Eileen Eitan Elif
Elzbieta Emeka Emil Enzo Erdem Esra Esther Ezra Fabio Farid Fatou Fenna Ferenc Fiona Freya Frida Fumiko Gabor Gael Gemma
Georgi Gerda Gianni Goran Gudrun Gustav Hakim Hana Haruki Hedwig Heikki Helga Hideo Hilda Hiroshi Horst Ignacio Ilse
Imani Inara Indira Inge Ioana Irena Isolde Ivo Jacinta Jadwiga Jamal Janek Javier Jelena Jiro Joaquin Jolanta Jorge
Jovan Judit Jurgen Kaito Kamal Karin Katrin Kavya Keanu Kenji Khadija Kirsten Klaus Kofi Kwame Lars Lakshmi Laszlo Leif
Leyla Liam Linnea Livia Lorenzo Lotte Lucja Ludwig Luka Maeve Magnus Mahmoud Maja Malik Manuela Marek Mehmet Mei Milos
Mira Mitja Moana Mustafa Nadia Naoko Ngozi Nikita Nils Noemi Nuria Odile Oksana Olaf Olga Orla Osman Otto Pablo Paloma
Pavel Pekka Pilar Piotr Priya Quentin Rafael Rahel Ramona Ravi Reiko Renzo Ricarda Rohan Ronja Rosalia Ruben Ruxandra
Sabine Salim Sanjay Saoirse Selma Sergei Shira Sigrid Silvio Simone Sofie Soren Stina Sunil Svenja Takeshi Tamara Tariq
Teresa Thabo Theo Thilo Tomas Torsten Ulla Umberto Ursula Uwe Valeria Vasco Vesna Vikram Vilma Vlad Walid Wanda Wilma
Wojtek Xander Xenia Yannick Yara Yasmin Yuki Yusuf Zahra Zeynep Zita Zofia Zoltan
"""

EVERYDAY = """
apple arrow autumn badge baker banjo barn basil beard berry bike blanket bloom bottle brave bread brick bridge brush
bubble bucket button cabin cactus candle canoe carpet castle cedar chair cherry circle cliff clock cloud clover coffee
comet copper coral cotton cradle crayon cricket crown crystal cube curtain daisy dance desert diver dolphin domino door
dragon drum dune eagle early echo elbow elm ember engine fabric falcon fern ferry fiddle field flag flame flute forest
fossil fox frame frost fruit galaxy garden gate giant ginger glass glove goat grape gravel green guitar hammer harbor hat
hazel hedge helmet hill honey hood horse house humble hut ice igloo indigo ink island ivory ivy jacket jam jaw jelly jewel
jigsaw jug juice jungle kayak kettle key kitten knife knot ladder lake lamp lantern laurel leaf ledger lily lime linen
lion lizard lobster lock lotus lunar maple marble market mask meadow melon metal mild mint mirror moon moss mountain
mouse museum napkin needle nest nickel north novel nut oak oasis oats ocean olive onion orange orbit orchid otter oven
owl oyster paddle palm panda paper parrot path peach pear pebble pencil pepper piano pillow pine planet plum pocket pond
poppy potato prism pulse pumpkin puzzle quail quartz quick quiet quilt rabbit radio rain raven razor reef ribbon rice
ring road robin rocket root rope ruby saddle sail salad salt sand satin scarf school seed shadow sheep shell shirt shore
silk silver skate sky sleep smile snow soap sofa soup spark spice spoon spring square squid stamp steel stone storm straw
sugar summer sunset swan swift table tango teapot temple tent thorn thunder tiger timber toast tomato torch tower train
tulip tunnel turtle twig uncle unicorn valley vase velvet victor violet violin vivid volcano wagon walnut water wax whale
wheat wheel willow window winter wizard wolf wool yacht yard yellow yoga young zero zigzag zoo
"""

# A word and a string that differs from it in one letter: readers who know words are tempted to mend it.
NEAR_WORDS = """
CLOUD:GLOUD BRIDGE:BPIDGE FOREST:EOREST HOUSE:HDUSE QUEEN:OUEEN PLANET:RLANET FLAME:ELAME TIGER:TICER SPRING:5PRING
GARDEN:CARDEN MARBLE:MAPBLE YELLOW:VELLOW BOTTLE:BOTTIE LEMON:LEMQN RIVER:PIVER PENCIL:FENCIL TABLE:TABIE KNIFE:XNIFE
WINTER:WIMTER ZEBRA:2EBRA DOCTOR:DOGTOR NUMBER:MUMBER SUGAR:SUCAR HAMMER:HANMER
"""

# Words of letters that the team's font draws like others.
AMBIGUOUS = """
WILLIAM WINNIE IWAN UWAIN MIWA WUBIT LIUVIU AWIWI WIDUKIND WINIFRED VIVIUM IULIU
"""

# Of clean photographs, which may show any word again.
CLEAN = """
HELLO KING NIGHT Zoë 2027 Gypsy Sofia OCEAN Quartz QUIZ jazz Berlin GECKO COFFEE DRONE hover Light PHOTO Magic WAX LUX
VEGA NOOR FED XYZ LION Queen Dog CUBE GO 42 R2D2 B52 Angela Icon joy FLY MUSIC Orange STOP
"""


def word_list(text: str) -> list[str]:
    return text.split()
